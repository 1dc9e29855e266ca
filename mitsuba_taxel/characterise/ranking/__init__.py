"""Variants of a sensor, ranked by a figure of merit: experiments enter, probabilities and their words leave."""
