"""Angular laws of LEDs and phototransistors, and the weighted points on their faces where light paths end."""
