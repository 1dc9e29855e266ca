"""Ranking of variants of a sensor by a figure of merit: from experiments to probabilities, and their text."""
