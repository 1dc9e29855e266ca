"""Storage of studies on disk."""
