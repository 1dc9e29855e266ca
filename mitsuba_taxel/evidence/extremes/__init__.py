"""The table of extreme cases: pads, scenes and circuits that are either right or refused in one line.

Cases enter; rows with an independent check leave (`taxel bench stability`).
"""
