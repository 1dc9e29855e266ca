"""Figures of merit of a sensor from its readings against force."""

from __future__ import annotations

from mitsuba_taxel.characterise.sensitivity import sensitivity, sensitivity_table

__all__ = ["sensitivity", "sensitivity_table"]
