"""Studies on disk, and opened again."""
