"""Derivatives of readings with respect to parameters of a scene, with their errors.

Input: scenes, states of pads and the requested parameters. Output: derivatives of readings, of clearances and of
critical loads. Where light needs random paths, they are differences of readings that share their random numbers.
"""
