"""Figures of merit of a sensor from its readings against force, simulated or measured."""

from __future__ import annotations

from mitsuba_taxel.characterise.characteristics import characteristics
from mitsuba_taxel.characterise.equations import Deviation, hysteresis, nonlinearity, repeatability
from mitsuba_taxel.characterise.experiment import Branch, Experiment
from mitsuba_taxel.characterise.load_lines import experiments
from mitsuba_taxel.characterise.measurement import Measurement, read_measurement
from mitsuba_taxel.characterise.mechanics_error import deviating
from mitsuba_taxel.characterise.recorded_runs import recorded_experiment
from mitsuba_taxel.characterise.sensitivity import sensitivity, sensitivity_table
from mitsuba_taxel.characterise.simulated import Simulated, simulated_experiments
from mitsuba_taxel.characterise.slopes import Slopes, slopes
from mitsuba_taxel.characterise.tangential import TangentialMap, symmetric_pairs, tangential_map, tangential_maps

__all__ = [
    "Branch",
    "Deviation",
    "Experiment",
    "Measurement",
    "Simulated",
    "Slopes",
    "TangentialMap",
    "characteristics",
    "deviating",
    "experiments",
    "hysteresis",
    "nonlinearity",
    "read_measurement",
    "recorded_experiment",
    "repeatability",
    "sensitivity",
    "sensitivity_table",
    "simulated_experiments",
    "slopes",
    "symmetric_pairs",
    "tangential_map",
    "tangential_maps",
]
