"""Mitsuba plugins, a file each; the name of the file is the name of the plugin."""
