"""Checks that readings of a loaded scene would be right: what is not modelled is refused, with the object and a remedy.

Input: loaded scenes. Output: errors and warnings. Some checks trace a few rays through the scene.
"""
