"""Angular laws of LEDs and phototransistors, and the weighted points on their faces that are the ends of light paths.
"""
