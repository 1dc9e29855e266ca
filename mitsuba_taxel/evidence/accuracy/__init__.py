"""Error against time: the cost of a given error by method, and the work that a scene does not need.

Input: chains from force to reading. Output: tables and plots of true error, stated error and seconds (`taxel bench
accuracy`, `speed`, `nominal`, `ramp`).
"""
