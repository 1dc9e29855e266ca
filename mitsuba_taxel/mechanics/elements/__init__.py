"""Taylor-Hood elements, their assembly, loads, constraints and linear solvers."""
