"""Errors, checks of arguments, caches, files, processes and units, which all other packages use.

Input: plain values, paths and functions. Output: checked values, errors in one line, complete files, cached results and
worker processes; nothing here knows pads or light.
"""
