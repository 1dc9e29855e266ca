"""Error against time: what a given error costs, by engine, and what a scene does not pay for.

Chains from force to reading enter; tables and plots of true error, stated error and seconds leave (`taxel bench
accuracy`, `speed`, `nominal`, `ramp`).
"""
