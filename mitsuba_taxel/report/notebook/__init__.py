"""What notebooks show of the package's objects."""
