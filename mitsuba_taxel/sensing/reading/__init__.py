"""Readings and what they consist of: random paths in increments, errors by their source, cost, further results.

Input: prepared scenes. Output: `Readings`, with every error that is known and the words for those that are not.
`sensing.targets` and `sensing.measurement` choose mesh, number of points and engine.
"""
