"""Error against time: the cost of a given error by method, and the work that a scene does not need.

Chains from force to reading enter; tables and plots of true error, stated error and seconds leave (`taxel bench
accuracy`, `speed`, `nominal`, `ramp`).
"""
