"""Error against computing time: the time that each method needs for a given error, and the time saved by omitting work
that a scene does not need.

Input: scenes, from force to reading. Output: tables and plots of true error, stated error and seconds (`taxel bench
accuracy`, `speed`, `nominal`, `ramp`).
"""
