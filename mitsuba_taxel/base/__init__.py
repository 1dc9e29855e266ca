"""Errors, checks of arguments, files, timing of stages, units."""
