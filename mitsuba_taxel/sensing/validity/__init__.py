"""Whether readings of a loaded scene would be right: what is not modelled is refused, with the part and its remedy.

Loaded scenes enter, and nothing leaves but errors and warnings. Some checks trace a few rays through the scene.
"""
