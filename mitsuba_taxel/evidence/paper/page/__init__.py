"""Sections of the page on the paper (`paper.md`), a file each."""
