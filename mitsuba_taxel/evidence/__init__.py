"""Evidence that results are right: benches with stated and true errors, other programs, the paper, measured sensors.

Cases enter, drawn at random or listed; tables, pages and figures of the documentation leave, each by one command. No
other room imports this one, but for the command line.
"""
