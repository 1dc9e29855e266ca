"""Light in closed cells of diffuse walls, solved without random numbers.

Scenes and deformed pads enter, and become patches with an LED and a phototransistor as ends; readings with their error
leave. The solver itself is `mitsuba_taxel.transport`.
"""
