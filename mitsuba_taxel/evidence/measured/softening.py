"""Mullins' effect in one cell of the measured pad, to first order, fitted to the measured hysteresis loops.

The states of the first loading are those of the law. Let eta - 1 be the change of the stress on the way back. To first
order in it, the energy of the pad at a given travel changes by the integral of eta - 1 over the energy density W, the
force by the derivative of that energy with respect to the travel (the displacements are stationary), and the
displacements by the linear response of the pad to the additional stress. So a single elastic load path gives the loops
for all constants.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.special import erf

from mitsuba_taxel.evidence.measured import measured
from mitsuba_taxel.evidence.measured.bench_pad import IndenterPress
from mitsuba_taxel.evidence.measured.memory_fit import HysteresisLoop
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies

TRAVELS = (0.8, 1.1, 1.4, 1.7)
"""Travels in mm of the computed states, before the largest one."""
WALL, MESH_SIZE = 6.0, 1.6
"""Silicone beside the cell, and size of the elements, in mm."""
INNER = slice(10, None)
"""Points of a curve of 201 at which its width is measured: not those near rest."""
STARTS = ((7.0, 1e-3, 0.5), (2.5, 3e-3, 2.0), (8.0, 1e-3, 0.1))
MEASURED = HysteresisLoop(
    measured.FORCE_LOOP, measured.ENERGY_LOST, measured.VOLTAGE_LOOP_AT_FORCE, measured.VOLTAGE_LOOP_AT_TRAVEL
)


class SofteningFit(NamedTuple):
    """Constants of Mullins' effect, and the widths of loops that they cause.

    Attributes
    ----------
    constants : tuple[float, float, float]
        r, m relative to Young's modulus, and beta.
    loop : HysteresisLoop
        Widths of the loops; those of the reading are signed, positive where it is larger at equal force, and smaller
        at equal travel, on the way back.
    """

    constants: tuple[float, float, float]
    loop: HysteresisLoop


def first_loading(store: PaperStudies, press: IndenterPress, late: float) -> xr.Dataset:
    """Compute the first loading of one cell, or read it from the store.

    The dataset over ``travel`` has the ``force`` in N for a modulus of 1 MPa, the mean displacement of the ``roof`` in
    mm, and over ``point``, the quadrature points, the ``energy`` density in MPa, their volume ``weight`` in mm³, and
    the ``response`` in mm: the change of ``roof`` by an additional isochoric stress at a point that equals that of the
    law.
    """
    travels = (*TRAVELS, round(max(measured.PRESSES[measured.PRESSED].travels) + late, 3))
    request = {**press._asdict(), "travels": travels, "wall": WALL, "mesh_size": MESH_SIZE}
    return store.study("pressed/one_cell", request, lambda: _computed(press, travels))


def _computed(press: IndenterPress, travels: tuple[float, ...]) -> xr.Dataset:
    from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean, linearise, load_path
    from mitsuba_taxel.mechanics.elements.elements import Elements
    from mitsuba_taxel.mechanics.materials.viscoelastic import tensors
    from mitsuba_taxel.mechanics.results.contact_pressure import indentation_of
    from mitsuba_taxel.pads import Pad

    free = measured.CORE_HEIGHT - measured.COLLAR_HEIGHT
    sizes: dict[str, Any] = {"cell_size": measured.CORE, "cell_height": free, "wall": WALL, "pitch": measured.PITCH}
    pad = Pad("parallelepiped", 1, 1, height=press.height - measured.COLLAR_HEIGHT, **sizes)
    load = IndenterDisplacement(Indenter(press.indenter, radius=press.radius))
    rows = []
    for travel in travels:
        (state,) = load_path(pad, NeoHookean(1.0), [(0, 0, -travel)], load=load, mesh_size=MESH_SIZE)
        linear, elements = linearise(state), Elements(state.mesh, state.material)
        points, displacement = state.mesh.points, linear.displacement
        inside = (np.abs(points[:, :2]) < measured.CORE / 2 + 1e-6).all(axis=1)
        roof = np.flatnonzero(inside & (np.abs(points[:, 2] - free) < 1e-6))

        # The tangent is symmetric: the work of the forces of a stress along the displacements by a unit force on the
        # roof is the displacement of the roof by these forces.
        unit = np.zeros_like(points)
        unit[roof, 2] = -1 / len(roof)
        along = elements.gradient(slice(None), linear.by_forces(unit))
        gradient = elements.gradient(slice(None), displacement)
        stress = tensors(elements.isochoric_stress(displacement))
        response = -elements.weight * (((gradient + np.eye(3)) @ stress) * along).sum(axis=(-2, -1))
        force = -indentation_of(state)[1].nodal_forces.sum(axis=0)[2]
        fields = elements.isochoric_energy(displacement), response, elements.weight
        rows.append((travel, force, -displacement[roof, 2].mean(), *(field.ravel() for field in fields)))

    # Elements are smaller under a deeper indenter: only states on the last mesh are used.
    rows = [row for row in rows if len(row[3]) == len(rows[-1][3])]
    kept, forces, roofs, energies, responses, weights = zip(*rows, strict=True)
    both = ("travel", "point")
    return xr.Dataset(
        {
            "force": ("travel", np.array(forces), {"units": "N"}),
            "roof": ("travel", np.array(roofs), {"units": "mm"}),
            "energy": (both, np.array(energies), {"units": "MPa"}),
            "response": (both, np.array(responses), {"units": "mm"}),
            "weight": ("point", weights[0], {"units": "mm3"}),
        },
        coords={"travel": ("travel", np.array(kept), {"units": "mm"})},
    )


def loop_of(study: xr.Dataset, constants: tuple[float, float, float]) -> HysteresisLoop:
    """Widths of the loops of a first cycle in percent, to first order; signs as in :class:`SofteningFit`.

    The displacement of the roof stands for the reading.
    """
    r, m, beta = constants
    energy, travel = study.energy.values, np.insert(study.travel.values, 0, 0.0)
    largest = energy.max(axis=0)
    width = m + beta * largest

    def integral(x: np.ndarray) -> np.ndarray:
        return x * erf(x) + np.exp(-(x**2)) / np.sqrt(np.pi)

    def curve(values: np.ndarray) -> CubicSpline:
        return CubicSpline(travel, np.insert(values, 0, 0.0))

    # Energy, force and roof of unloading minus those of loading, at equal travel; then the roof at equal force.
    distance = (largest - energy) / width
    lost = -(integral(largest / width) - integral(distance)) * width @ study.weight.values / r
    at = np.linspace(0.0, travel[-1], 201)
    force, roof = curve(study.force.values), curve(study.roof.values)
    force_change = curve(lost).derivative()(at)
    at_travel = curve(-(erf(distance) * study.response.values).sum(axis=1) / r)(at)
    at_force = at_travel - roof.derivative()(at) / force.derivative()(at) * force_change
    largest_force, largest_roof = float(study.force[-1]), float(study.roof[-1])
    return HysteresisLoop(
        -100 * _largest(force_change) / largest_force,
        -100 * float(lost[-1] / force.integrate(0.0, travel[-1])),
        100 * _largest(at_force) / largest_roof,
        -100 * _largest(at_travel) / largest_roof,
    )


def _largest(values: np.ndarray) -> float:
    inner = values[INNER]
    return float(inner[np.abs(inner).argmax()])


def fit(study: xr.Dataset, beta: float | None = None) -> SofteningFit:
    """Fit the constants to the four measured widths by least squares; ``beta`` may be given."""
    fixed = [] if beta is None else [beta]

    def constants(logs: np.ndarray) -> tuple[float, float, float]:
        r, m, last = [*map(float, np.exp(logs)), *fixed]
        return r, m, last

    def residuals(logs: np.ndarray) -> np.ndarray:
        return np.array(loop_of(study, constants(logs))) - MEASURED

    starts = [np.log(start[: 3 - len(fixed)]) for start in STARTS]
    best = min((least_squares(residuals, start) for start in starts), key=lambda solution: float(solution.cost))
    return SofteningFit(constants(best.x), loop_of(study, constants(best.x)))
