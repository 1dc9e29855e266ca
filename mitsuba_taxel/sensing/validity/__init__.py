"""Checks that the readings of a loaded scene would be right. Objects and effects that are not modelled are refused with
an error that names the object and a remedy.

Input: loaded scenes. Output: errors and warnings. Some checks trace a few rays through the scene.
"""
