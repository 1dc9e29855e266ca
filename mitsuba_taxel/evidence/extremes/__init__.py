"""The table of extreme cases: pads, scenes and circuits, each of which must be right or refused in one line.

Input: cases. Output: rows with an independent check (`taxel bench stability`).
"""
