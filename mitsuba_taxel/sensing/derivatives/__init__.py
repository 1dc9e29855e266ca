"""Derivatives of readings with respect to parameters of a scene, with their errors.

Scenes, states of pads and the requested parameters enter; derivatives of readings, of clearances and of critical loads
leave. Where light needs random paths, they are differences of readings that share their random numbers.
"""
