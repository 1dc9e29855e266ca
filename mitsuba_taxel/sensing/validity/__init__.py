"""Checks that readings of a loaded scene would be right: what is not modelled is refused, with the object and a remedy.

Loaded scenes enter; errors and warnings leave. Some checks trace a few rays through the scene.
"""
