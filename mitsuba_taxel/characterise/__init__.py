"""Figures of merit of a sensor from its readings against force."""
