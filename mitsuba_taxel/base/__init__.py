"""Errors, checks of arguments, caches, files, processes and units, which all other packages use."""
