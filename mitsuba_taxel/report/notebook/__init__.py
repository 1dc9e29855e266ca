"""Display of the package's objects in notebooks."""
