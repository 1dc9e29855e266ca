"""Tables that say how the package does at the extremes, each made by one command."""
