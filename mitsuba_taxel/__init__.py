"""Simulation of optoelectronic tactile sensors: force, deformed pad, light, reading."""
