"""The table of extreme cases: pads, scenes and circuits, each of which must be right or refused in one line.

Cases enter; rows with an independent check leave (`taxel bench stability`).
"""
