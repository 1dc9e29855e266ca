"""Angular laws of LEDs and phototransistors, and these as weighted points: the ends of light paths."""
