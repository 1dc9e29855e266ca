"""Mitsuba BSDFs, one file each."""
