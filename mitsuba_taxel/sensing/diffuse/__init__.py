"""Light in closed cells with diffuse walls, solved without random numbers.

Input: scenes and deformed pads, whose walls are divided into patches. Output: readings with their error. The solver
itself is `mitsuba_taxel.transport`.
"""
