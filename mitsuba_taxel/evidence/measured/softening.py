"""Mullins' effect in cells of the measured pad, to first order, fitted to the measured hysteresis loops of taxel 13.

During the first loading, the stress is that of the law. On unloading it is multiplied by eta. To first order in eta -
1, the energy of the pad at a given travel changes by the integral of eta - 1 over the energy density W. The force
changes by the derivative of that energy with respect to the travel, because the displacements are stationary. The
displacements change by the linear response of the pad to the additional stress. So a single elastic load path gives the
loops for all constants.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.special import erf

from mitsuba_taxel.evidence.measured import bench_pad, measured
from mitsuba_taxel.evidence.measured.bench_pad import IndenterPress
from mitsuba_taxel.evidence.measured.memory_fit import TIMES, HysteresisLoop, PronyFit, linear_tail, measured_tail
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import Load, NeoHookean
    from mitsuba_taxel.pads import Pad

SHARES = (0.4, 0.55, 0.7, 0.85, 1.0)
"""Computed travels or forces, relative to the largest."""
WALL, MESH_SIZE = 6.0, 1.6
"""Silicone beside the cell, and size of the elements, in mm."""
CORNER = 5
"""Number of the taxel in the corner of the pad, for which the four cells of the corner are computed."""
INNER = slice(10, None)
"""Points of a curve of 201 at which its width is measured: not those near rest."""
STARTS = ((7.0, 1e-3, 0.5), (2.5, 3e-3, 2.0), (8.0, 1e-3, 0.1))
MEASURED = HysteresisLoop(
    measured.FORCE_LOOP, measured.ENERGY_LOST, measured.VOLTAGE_LOOP_AT_FORCE, measured.VOLTAGE_LOOP_AT_TRAVEL
)
NOTHING = HysteresisLoop(0.0, 0.0, 0.0, 0.0)


class SofteningFit(NamedTuple):
    """Fitted constants of Mullins' effect, and the widths of the hysteresis loops that it causes.

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


def first_loading(
    store: PaperStudies, press: IndenterPress, late: float, taxel: int = measured.PRESSED
) -> xr.Dataset:
    """Compute the first loading of a taxel, or read it from the store. The computed part of the pad is one cell, or the
    four cells of the corner.

    The dataset over ``travel`` has the ``force`` in N for a modulus of 1 MPa, and the mean displacement of the ``roof``
    in mm. Over ``point``, the quadrature points, it has the ``energy`` density in MPa, the volume ``weight`` in mm³,
    and the ``response`` in mm: the change of ``roof`` by an additional isochoric stress at a point that equals the
    stress of the law.
    """
    from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean
    from mitsuba_taxel.pads import Pad

    largest = max(measured.PRESSES[taxel].travels) + late
    travels = [round(share * largest, 3) for share in SHARES]
    side = 2 if taxel == CORNER else 1
    edge = (measured.PAD_SIDE - measured.CORE - (bench_pad.SIDE - 1) * measured.PITCH) / 2
    sizes: dict[str, Any] = {
        "height": press.height - measured.COLLAR_HEIGHT,
        "cell_size": measured.CORE,
        "cell_height": measured.CORE_HEIGHT - measured.COLLAR_HEIGHT,
        "wall": edge if taxel == CORNER else WALL,
        "pitch": measured.PITCH,
    }
    x = (side - 1) / 2 * measured.PITCH
    load = IndenterDisplacement(Indenter(press.indenter, radius=press.radius, at=(x, x)))
    request = {**press._asdict(), "travels": travels, "side": side, **sizes, "mesh_size": MESH_SIZE}
    return store.study(
        f"pressed/first_loading_{taxel}",
        request,
        lambda: _computed(Pad("parallelepiped", side, side, **sizes), NeoHookean(1.0), load, travels, x),
    )


def paper_loading(store: PaperStudies) -> xr.Dataset:
    """Compute the first loading of one parallelepiped cell of the paper, or read it from the store.

    The dataset is like that of :func:`first_loading`. ``force`` is the force on the top, and ``travel`` is the force as
    a fraction of the largest force.
    """
    from mitsuba_taxel.mechanics import NeoHookean, SpreadForce
    from mitsuba_taxel.pads import Pad

    largest = paper.MEASURED_FORCE / measured.CELLS_OF_EXPERIMENTS
    request = {"force": largest, "shares": SHARES}
    forces = [share * largest for share in SHARES]
    return store.study(
        "cycle/first_loading",
        request,
        lambda: _computed(Pad("parallelepiped", 1, 1), NeoHookean(), SpreadForce(), forces, 0.0),
    )


def _computed(pad: Pad, law: NeoHookean, load: Load, values: list[float], x: float) -> xr.Dataset:
    """Compute the states of a first loading, at values of the load along -z; the cell is at (x, x)."""
    from mitsuba_taxel.mechanics import linearise, load_path
    from mitsuba_taxel.mechanics.elements.elements import Elements
    from mitsuba_taxel.mechanics.materials.viscoelastic import tensors
    from mitsuba_taxel.mechanics.results.contact_pressure import indentation_of

    pressed = load.gives_displacement
    rows = []
    for value in values:
        mesh_size = MESH_SIZE if pressed else None
        (state,) = load_path(pad, law, [(0, 0, -value)], load=load, mesh_size=mesh_size)
        linear, elements = linearise(state), Elements(state.mesh, state.material)
        points, displacement = state.mesh.points, linear.displacement
        inside = (np.abs(points[:, :2] - x) < pad.cell_size / 2 + 1e-6).all(axis=1)
        roof = np.flatnonzero(inside & (np.abs(points[:, 2] - pad.cell_height) < 1e-6))

        # The tangent is symmetric: the work of the forces of a stress along the displacements by a unit force on the
        # roof is the displacement of the roof by these forces.
        unit = np.zeros_like(points)
        unit[roof, 2] = -1 / len(roof)
        along = elements.gradient(slice(None), linear.by_forces(unit))
        gradient = elements.gradient(slice(None), displacement)
        stress = tensors(elements.isochoric_stress(displacement))
        response = -elements.weight * (((gradient + np.eye(3)) @ stress) * along).sum(axis=(-2, -1))
        force = -indentation_of(state)[1].nodal_forces.sum(axis=0)[2] if pressed else value
        fields = elements.isochoric_energy(displacement), response, elements.weight
        rows.append((value, force, -displacement[roof, 2].mean(), *(field.ravel() for field in fields)))

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


def loop_of(study: xr.Dataset, constants: tuple[float, float, float], play: float = 0.0) -> HysteresisLoop:
    """Widths of the hysteresis loops of a first cycle in percent, to first order; their signs are explained at
    :class:`SofteningFit`.

    The displacement of the roof represents the reading. On unloading, the pad is pressed by ``play`` mm less at equal
    travel, because it has slipped or the robot has play.
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
    force_change = curve(lost).derivative()(at) - play * force.derivative()(at)
    at_travel = curve(-(erf(distance) * study.response.values).sum(axis=1) / r)(at) - play * roof.derivative()(at)
    at_force = at_travel - roof.derivative()(at) / force.derivative()(at) * force_change
    largest_force, largest_roof = float(study.force[-1]), float(study.roof[-1])
    return HysteresisLoop(
        -100 * _largest(force_change) / largest_force,
        -100 * float((lost[-1] - play * largest_force) / force.integrate(0.0, travel[-1])),
        100 * _largest(at_force) / largest_roof,
        -100 * _largest(at_travel) / largest_roof,
    )


def _largest(values: np.ndarray) -> float:
    inner = values[INNER]
    return float(inner[np.abs(inner).argmax()])


def fit(
    study: xr.Dataset, beta: float | None = None, play: float = 0.0, others: HysteresisLoop = NOTHING
) -> SofteningFit:
    """Fit the constants of Mullins' effect to the four measured widths, by least squares. ``beta`` may be given. The
    widths ``others`` by other causes are added to those of Mullins' effect.
    """
    fixed = [] if beta is None else [beta]

    def constants(logs: np.ndarray) -> tuple[float, float, float]:
        r, m, last = [*map(float, np.exp(logs)), *fixed]
        return r, m, last

    def residuals(logs: np.ndarray) -> np.ndarray:
        return np.array(loop_of(study, constants(logs), play)) + others - MEASURED

    starts = [np.log(start[: 3 - len(fixed)]) for start in STARTS]
    bounds = np.log([1.01, 1e-5, 1e-3][: len(starts[0])]), np.log([1e3, 1.0, 1e2][: len(starts[0])])
    solutions = [least_squares(residuals, start, bounds=bounds) for start in starts]
    best = constants(min(solutions, key=lambda solution: float(solution.cost)).x)
    return SofteningFit(best, HysteresisLoop(*np.add(loop_of(study, best, play), others).tolist()))


def hysteresis_under_force(study: xr.Dataset, constants: tuple[float, float, float]) -> float:
    """Width in percent of the hysteresis loop of the roof's displacement at equal force, from :func:`paper_loading`.
    The constant m is in MPa.
    """
    r, m, beta = constants
    largest = study.energy.values.max(axis=0)
    distance = (largest - study.energy.values) / (m + beta * largest)
    change = (erf(distance) * study.response.values).sum(axis=1) / r
    return 100 * float(np.abs(change).max() / study.roof.values[-1])


def softened_tail(weights: np.ndarray, eta: float) -> np.ndarray:
    """Strain of a linear viscoelastic solid after release, as from `memory_fit.linear_tail`, if Mullins' effect softens
    its long-term spring by the factor ``eta``.
    """
    # As in `linear_tail`; without stress, (eta (1 - G) + G) strain is the sum of all p, with the sum G of the weights.
    stiffness = eta * (1 - weights.sum()) + weights.sum()
    rates = -(np.eye(len(weights)) - weights[:, None] / stiffness) / np.array(TIMES)[:, None]
    return np.array([(expm(rates * time) @ weights).sum() for time in measured.TAIL_TIMES]) / stiffness


class SoftenedCreep(NamedTuple):
    """Prony weights fitted to the voltage after release, with a long-term spring that Mullins' effect has softened.

    Attributes
    ----------
    weights : (k,) ndarray
        Prony weights, fitted to the voltage after release again.
    misfit : float
        Largest difference from the measured changes, relative to them.
    hold : float
        Mean force in the first time window of the hold, relative to that at its end; of a linear solid.
    """

    weights: np.ndarray
    misfit: float
    hold: float


def creep(memory: PronyFit, eta: float) -> SoftenedCreep:
    """Fit the Prony weights again to the voltage after release, with a long-term spring that is softened by ``eta``.

    The computed changes are those of :func:`softened_tail`, times the ratio of the changes computed by finite elements
    to those of a linear solid without softening.
    """
    first, target = np.array([weight for weight, _ in memory.terms]), measured_tail()
    ratio = memory.tail / linear_tail(first)

    def misfit(logs: np.ndarray) -> np.ndarray:
        return softened_tail(np.exp(logs), eta) * ratio / target - 1

    logs = least_squares(misfit, np.log(first)).x
    weights = np.exp(logs)
    times = np.linspace(*measured.HOLD_WINDOWS[0], 1000)
    relaxed = (weights * np.exp(-times[:, None] / np.array(TIMES))).sum(axis=1).mean() / (1 - weights.sum())
    return SoftenedCreep(weights, float(np.abs(misfit(logs)).max()), 1 + float(relaxed))
