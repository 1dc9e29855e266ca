"""Mitsuba sensors, one file each."""
