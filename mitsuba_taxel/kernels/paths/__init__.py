"""Paths of light: how directions are drawn, what guides them to small detectors, how they are traced and recorded."""
