"""Commands that read scenes: one, or a study of many."""
