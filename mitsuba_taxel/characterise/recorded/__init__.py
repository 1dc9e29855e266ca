"""Recordings of a sensor on the bench: from tables of force and voltage to experiments with their noise."""
