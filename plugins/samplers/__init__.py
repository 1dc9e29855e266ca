"""Mitsuba samplers, one file each."""
