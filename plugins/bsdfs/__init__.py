"""Mitsuba bsdfs, one file each."""
