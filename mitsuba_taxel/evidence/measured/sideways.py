"""The paper's pads under tangential forces, in volts per newton (Table 3)."""

from __future__ import annotations

import xarray as xr

from mitsuba_taxel.characterise.volts import volts_table
from mitsuba_taxel.electronics import Circuit
from mitsuba_taxel.evidence.measured.cycles import PER_FORCE, POINTS
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.evidence.paper.scenes import YOUNGS_MODULUS
from mitsuba_taxel.studies import sweep

FORCES = (0.0, 1.0, 2.0, 3.0)
"""Forces in N along x or y; the largest force of the experiments is not published."""


def pushed(store: PaperStudies, cell: str, along: str) -> xr.Dataset:
    """Compute readings of an elastic pad under tangential forces ``fx`` or ``fy``, at the normal force of the
    experiments."""
    vary = {along: list(FORCES)}
    defines = {"cell": cell, "youngs_modulus": YOUNGS_MODULUS, "fz": -paper.MEASURED_FORCE * PER_FORCE}
    request = {"vary": vary, "defines": defines, "points": POINTS}
    name = f"sideways/{cell}_{along}"
    return store.study(name, request, lambda: sweep("pad.xml", vary, defines, points=POINTS))


def largest_slope(study: xr.Dataset, circuit: Circuit) -> tuple[float, float]:
    """Slope of the most sensitive taxel in V/N and its error, for the total force on a pad with the number of cells of
    the experiments."""
    table = volts_table(study, circuit)
    best = table.loc[table.mean_slope_V_per_N.abs().idxmax()]
    return PER_FORCE * abs(best.mean_slope_V_per_N), PER_FORCE * best.mean_slope_V_per_N_error
