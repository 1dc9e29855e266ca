"""Mitsuba integrators, one file each."""
