"""Mitsuba shapes, one file each."""
