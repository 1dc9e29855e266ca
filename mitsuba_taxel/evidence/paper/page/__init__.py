"""Sections of the page of the paper, a file each. Input: studies of a rerun. Output: Markdown."""
