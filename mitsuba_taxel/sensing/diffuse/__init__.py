"""Light in closed cells of diffuse walls, solved without random numbers.

Input: scenes and deformed pads; they are divided into patches, with an LED and a phototransistor as ends. Output:
readings with their error. The solver itself is `mitsuba_taxel.transport`.
"""
