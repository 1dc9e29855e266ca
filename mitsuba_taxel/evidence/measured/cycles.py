"""Loading cycles of the paper's pads with viscoelastic silicone: sensitivity in volts per newton, nonlinearity and
hysteresis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.characterise import characteristics, simulated_experiments
from mitsuba_taxel.electronics import Circuit
from mitsuba_taxel.evidence.measured import measured
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.evidence.paper.scenes import YOUNGS_MODULUS
from mitsuba_taxel.studies import sweep

CELLS = 9
PER_FORCE = CELLS / measured.CELLS_OF_EXPERIMENTS
"""Number of cells of our pad, and its forces relative to those of the experiments, so that forces per cell are the
same."""
STEPS, POINTS = 5, 1024


class CycleFigures(NamedTuple):
    """Figures of merit of a pad: the least and the largest sensitivity of its taxels in V/N; nonlinearity and
    hysteresis of the most sensitive taxel in percent, with errors."""

    least: float
    most: float
    nonlinearity: tuple[float, float]
    hysteresis: tuple[float, float]


def cycle(store: PaperStudies, cell: str, terms: tuple[tuple[float, float], ...]) -> xr.Dataset:
    """Compute readings along one loading cycle, with the force per cell and the rate of the experiments.

    The modulus in the paper is taken as the long-term modulus.
    """
    fraction = np.concatenate([np.arange(STEPS + 1), np.arange(STEPS - 1, -1, -1)]) / STEPS
    forces = -paper.MEASURED_FORCE * PER_FORCE * fraction
    times = measured.RAMP_SECONDS * np.arange(len(fraction)) / STEPS
    prony = "; ".join(f"{g:.6g} {tau:g}" for g, tau in terms)
    rows = {"time": times.tolist(), "fz": np.round(forces, 6).tolist()}
    instant_modulus = round(YOUNGS_MODULUS / (1 - sum(g for g, _ in terms)), 4)
    defines = {"cell": cell, "prony": prony, "youngs_modulus": instant_modulus}
    request = {"together": rows, "defines": defines, "points": POINTS}
    return store.study(f"cycle/{cell}", request, lambda: sweep("pad.xml", {}, defines, together=rows, points=POINTS))


def circuit_at_rest(study: xr.Dataset) -> Circuit:
    """The circuit of the measured pad. The power of its LEDs is chosen such that the first step of a cycle has the
    measured mean voltage."""
    return Circuit(
        supply=measured.ADC_REFERENCE,
        load_resistance=measured.LOAD_RESISTANCE,
        transfer=measured.REST_VOLTAGE / measured.LOAD_RESISTANCE / float(study.power.isel(step=0).mean()),
        adc_bits=measured.ADC_BITS,
    )


def figures(study: xr.Dataset) -> CycleFigures:
    """Figures of merit of a loading cycle, measured through the circuit of :func:`circuit_at_rest`."""
    circuit = circuit_at_rest(study)
    experiments = simulated_experiments(study, circuit)
    table = characteristics(experiments.experiments, experiments.off)
    table = table[table.reading == "V"]
    slopes = table[(table.figure == "mean_slope") & (table.loading == 1)].set_index("taxel")
    per_force = PER_FORCE * slopes.value.abs()
    best = per_force.idxmax()

    def of_best(figure: str) -> tuple[float, float]:
        row = table[(table.figure == figure) & (table.taxel == best)].iloc[0]
        return float(row.value), float(row.error)

    return CycleFigures(float(per_force.min()), float(per_force.max()), of_best("nonlinearity"), of_best("hysteresis"))
