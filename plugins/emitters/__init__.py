"""Mitsuba emitters, one file each."""
