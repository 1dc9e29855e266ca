"""Long work: what it is doing, how long it took, its threads, limits and worker processes."""
