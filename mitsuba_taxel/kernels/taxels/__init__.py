"""LEDs and phototransistors: their faces, windows and directional laws."""
