"""How the package does: at the extremes, and error against time, each by one command."""
