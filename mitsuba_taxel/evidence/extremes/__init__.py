"""Tables of extreme cases of pads, scenes and circuits. The result of each case must be right, or the case must be
refused with a message of one line.

Input: cases. Output: rows with an independent check of each result (`taxel bench stability`).
"""
