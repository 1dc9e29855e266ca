"""Sections of the page of the paper, a file each: studies of a rerun enter, Markdown leaves."""
