"""Benchmarks of the package: extreme cases, accuracy against time, comparisons, each by one command."""
