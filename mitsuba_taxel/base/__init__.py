"""Errors, checks of arguments, caches, files, processes, units: what all other packages use."""
