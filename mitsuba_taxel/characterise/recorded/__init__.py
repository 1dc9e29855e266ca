"""Recordings of a sensor on the bench: tables of force and voltage enter, experiments with their noise leave."""
