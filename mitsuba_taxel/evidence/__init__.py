"""Evidence that results are right: benches with stated and true errors, other programs, the paper, measured sensors.

Input: cases, drawn at random or listed. Output: tables, pages and figures of the documentation, each by one command. No
other room imports this one, but for the command line.
"""
