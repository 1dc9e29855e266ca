"""Long computations: current activity, time by stage, threads, limits of memory, worker processes."""
