"""Extreme cases of the mechanics: each is solved, and its result is checked independently of the solver."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.processes.system import peak_memory
from mitsuba_taxel.evidence.extremes.table_case import TableCase
from mitsuba_taxel.evidence.rows.row import CONVERGED, MechanicsRow
from mitsuba_taxel.geometry.element_maps import map_determinants
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_slopes
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.singular_edges import judged_nodes
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath, pad_path
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE, Load
from mitsuba_taxel.mechanics.equilibrium.feet import where_linear
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import RESIDUAL_TOLERANCE
from mitsuba_taxel.mechanics.equilibrium.natural_step import TICKS
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected
from mitsuba_taxel.mechanics.load_paths import load_path
from mitsuba_taxel.mechanics.materials.laws import Material, NeoHookean
from mitsuba_taxel.mechanics.results.balance import reactions
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.pads.regions import REGIONS

MESH_SIZE = 2.0
"""Default mesh size in mm: coarse, as the table is about robustness."""
NORMAL = (0.0, 0.0, -20.0)
"""Default load, in N."""
FINER = 1.5
"""Ratio between the mesh size of a case and that of the finer mesh."""
JUST_BEFORE = 0.999
"""Load of the state that is reported for a path that ends early, relative to the load at its end."""
MOST_IMBALANCE = 1e-2
"""Allowed imbalance of forces, relative to the load, of an interpolated state with accurate displacements."""
MOST_UNDERSTATED = 2.0
"""Allowed change of the roofs' displacement on a finer mesh, relative to the stated error."""

_MIDPOINTS = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])


@dataclass(frozen=True)
class ExtremeCase(TableCase):
    """An extreme case of the mechanics: a pad, its material and its load.

    Attributes
    ----------
    value : tuple[float, ...]
        Value of the load, in N, mm or MPa.
    mesh_size : float
        Mesh size of the finite elements, in mm.
    in_one_step : bool
        Whether the whole load is applied in one Newton solve from the undeformed pad, instead of along the load path.
    with_finer_mesh : bool
        Whether the pad is also solved on elements smaller by a factor of 1.5.
    refused : bool
        Whether the program must refuse the case.
    """

    ROW = MechanicsRow
    name: str
    pad: Pad = Pad()
    material: Material = NeoHookean()
    load: Load = SPREAD_FORCE
    value: tuple[float, ...] = NORMAL
    mesh_size: float = MESH_SIZE
    in_one_step: bool = False
    with_finer_mesh: bool = False
    refused: bool = False

    def measured(self) -> MechanicsRow:
        """Solve and check the case in this process.

        Cached solutions are used, so that the CPU time is meaningful with an empty cache only.
        """
        start = time.process_time()
        outcome = _in_one_step(self) if self.in_one_step else _along_path(self)
        figures = outcome.figures | _state_figures(
            outcome.state
        )  # including the state's error, which is computed lazily
        seconds, megabytes = time.process_time() - start, peak_memory()
        if outcome.verdict == CONVERGED and self.with_finer_mesh and not self.in_one_step:
            figures["finer_change"] = _finer_change(self, outcome.state)
        row = MechanicsRow(self.name, outcome.verdict, seconds=seconds, megabytes=megabytes, **figures)  # type: ignore[arg-type]
        return with_flaw(row, self.refused)


@dataclass(frozen=True, eq=False)
class _Outcome:
    """Outcome of a case: the verdict, results of its load steps by attribute of `MechanicsRow`, and the last state if
    there is one."""

    verdict: str
    figures: dict[str, float | str]
    state: State | None


def with_flaw(row: MechanicsRow, refused: bool) -> MechanicsRow:
    """Add to a row the reason why it counts as a failure, if it does.

    Parameters
    ----------
    row : MechanicsRow
        Row without the result of the test.
    refused : bool
        Whether the program must refuse the case.
    """
    return replace(row, wrong=failure_of(row, refused))


def failure_of(row: MechanicsRow, refused: bool = False) -> str:
    """Test whether a row counts as a failure.

    Parameters
    ----------
    row : MechanicsRow
        The row.
    refused : bool
        Whether the program must refuse the case.

    Returns
    -------
    str
        Reason of the failure; empty if there is none.
    """
    if row.verdict.startswith("refused") != refused:
        return "it should be refused" if refused else "it should not be refused"
    numbers = (row.min_jacobian, row.residual, row.imbalance, row.roof)
    if row.verdict == CONVERGED and not all(map(math.isfinite, numbers)):
        return "not a number"
    if row.inverted or min(row.min_jacobian, row.node_jacobian) <= 0:
        return f"elements inverted from {row.inverted or 'the last state'} on"
    if row.residual > RESIDUAL_TOLERANCE or row.imbalance > MOST_IMBALANCE:
        return "out of balance"
    if row.finer_change > MOST_UNDERSTATED * row.stated_error:
        return "the stated error is too small"
    return ""


def _along_path(case: ExtremeCase) -> _Outcome:
    """Solve a case along its load path, up to its load or to the end of the path."""
    path = pad_path(case.pad, case.material, case.load, case.mesh_size)
    if case.load.driven is not None:
        path = path.driven  # on which the body is moved
    try:
        (state,) = load_path(case.pad, case.material, [case.value], load=case.load, mesh_size=case.mesh_size)
        return _Outcome(CONVERGED, _figures(case, path) or _solve_figures(state), state)
    except InputError as error:
        return _Outcome(f"refused: {error}", {}, None)
    except ComputationError as error:
        segments = list(path.segments.known.values())
        if not segments or math.isinf(segments[-1].limit):
            return _Outcome(f"refused: {error}", {}, None)
        # The path ends before the load: report its end, and the state just before it.
        last = path.segments.branches.get(segments[-1], segments[-1])
        value = last.value(last.limit)
        position = f" near {_listed(last.place)} mm" if np.isfinite(last.place).all() else ""
        verdict = f"ends at {_listed(value)} {path.load.unit}: {last.reason}{position}"
        if last.limit > segments[-1].limit:
            verdict += f"; buckled at {_listed(segments[-1].value(segments[-1].limit))} {path.load.unit}"
        last_value = last.value(JUST_BEFORE * last.limit)[None]
        (state,) = load_path(case.pad, case.material, last_value, load=path.load, mesh_size=case.mesh_size)
        return _Outcome(verdict, _figures(case, path), state)


def _in_one_step(case: ExtremeCase) -> _Outcome:
    """Solve a case by one Newton solve from the undeformed pad."""
    value = np.array(case.value)
    path = pad_path(case.pad, case.material, case.load, case.mesh_size)
    pad = path.segments.pad_for(np.zeros_like(value), value)
    try:
        solution, _ = pad.solve(np.zeros(pad.unknowns), value)
    except Rejected as rejection:
        return _Outcome(f"refused: {rejection}", {}, None)
    displacement, pressure = pad.split(solution.unknowns)
    state = State(
        mesh=path.mesh,
        material=case.material,
        load=case.load,
        value=value,
        displacement=displacement,
        pressure=pressure,
        min_jacobian=solution.min_jacobian,
        residual=solution.residual,
        newton_iterations=solution.iterations,
        stability_checked=solution.stability_checked,
    )
    return _Outcome(CONVERGED, {"steps": 1, "cutbacks": 0} | _solve_figures(state), state)


def _solve_figures(state: State) -> dict[str, float | str]:
    """Iterations, smallest Jacobian, residual and stability of one state, for cases whose load steps are not recorded:
    a single step, or friction."""
    return {
        "iterations": state.newton_iterations,
        "min_jacobian": state.min_jacobian,
        "residual": state.residual,
        "stability": _stability(state.stability_checked),
    }


def _figures(case: ExtremeCase, path: PadPath) -> dict[str, float | str]:
    """Results of all load steps of a path: iterations, cutbacks, smallest Jacobian, residual, stability, and the first
    load that inverts an element at a node."""
    segments = list(path.segments.known.values())
    branches = path.segments.branches.values()
    curves = [segment for branch in branches for segment in (branch.curve, branch.onwards) if segment]
    nodes = [node for segment in segments + curves for node in segment.nodes]
    if not nodes:
        return {}
    return {
        "iterations": sum(node.iterations for node in nodes),
        "steps": sum(len(segment.nodes) - 1 for segment in segments + curves),
        "cutbacks": sum(cutbacks(segment) for segment in segments + curves),
        "min_jacobian": min(node.min_jacobian for node in nodes),
        "residual": max(node.residual for node in nodes),
        "stability": _stability(all(node.stability_checked for node in nodes)),
        "inverted": next((text for segment in segments if (text := _first_inverted(case, path, segment))), ""),
    }


def _first_inverted(case: ExtremeCase, path: PadPath, segment: LoadSegment) -> str:
    """The first load of an accepted step, up to the load of the case, that inverts an element at a node, as text; empty
    if there is none."""
    pad = path.segments.pad_for(segment.origin, segment.direction)
    driven, linear = case.load.driven is not None, where_linear(path.mesh, path.load)
    reached = segment.limit if driven else float((np.array(case.value) - segment.origin) @ segment.direction)
    for node in segment.nodes:
        displacement = pad.split(node.unknowns)[0]
        if node.s <= min(segment.limit, reached) and node_jacobian(path.mesh, displacement, linear) <= 0:
            return f"{_listed(segment.value(node.s))} {path.load.unit}"
    return ""


def cutbacks(segment: LoadSegment) -> int:
    """Count the halved and abandoned load steps of a segment of a load path.

    Each accepted step is compared with the longest step that is allowed at its start. Steps that were planned to be
    shorter count as halved as well.
    """
    nodes = segment.nodes[:-1] if segment.mode.size else segment.nodes  # the last is where the pad buckles
    positions = [round(node.s / segment.tick) for node in nodes]
    halved = 0
    for position, following in zip(positions, positions[1:], strict=False):
        halved += round(math.log2(_longest(position, segment.ticks) / (following - position)))
    given_up = bool(positions) and (len(nodes) < len(segment.nodes) or segment.limit == segment.nodes[-1].s)
    return halved + (1 + round(math.log2(_longest(positions[-1], segment.ticks))) if given_up else 0)


def _longest(position: int, ticks: int) -> int:
    """Length of the longest load step that may begin at a position, in ticks (the shortest step)."""
    return min(position & -position, ticks) or TICKS


def _stability(checked: bool) -> str:
    return "stable" if checked else "not checked"


def _state_figures(state: State | None) -> dict[str, float | str]:
    """Checks of a state, computed independently of the solver: smallest Jacobian at nodes, balance of forces,
    displacement of the roofs and its stated error.

    The stated error of a state with self-contact is not computed, because it may take ten minutes.
    """
    if state is None:
        return {}
    linear = where_linear(state.mesh, state.load)
    roof = float(np.linalg.norm(mean_roof(state.mesh, state.displacement)))
    error = None if state.load.self_contact else state.error
    stated_error = error.displacement / roof if error and roof else math.nan
    return {
        "node_jacobian": node_jacobian(state.mesh, state.displacement, linear),
        "imbalance": reactions(state).imbalance,
        "roof": roof,
        "stated_error": stated_error,
    }


def node_jacobian(mesh: VolumeMesh, displacement: np.ndarray, linear: np.ndarray | None = None) -> float:
    """Smallest volume ratio J (Jacobian) of all elements, at their corners and at the other nodes in `judged_nodes`.

    Parameters
    ----------
    mesh : VolumeMesh
        The undeformed mesh.
    displacement : (N, 3) ndarray
        Displacement of the N nodes, in mm.
    linear : (m, q) ndarray of bool, optional
        Mask of the q quadrature points of each of m elements: True where the material law is linear. Corners at such
        points are not tested.
    """
    before, after = (map_determinants(points, mesh.tets) for points in (mesh.points, mesh.points + displacement))
    judged = judged_nodes(mesh)[mesh.tets]
    judged[:, :4] = True if linear is None else ~linear[:, :4]  # the first quadrature points
    return float((after / before)[judged].min())


def mean_roof(mesh: VolumeMesh, displacement: np.ndarray) -> np.ndarray:
    """Mean displacement of the roofs of all cells, weighted by undeformed area.

    Parameters
    ----------
    mesh : VolumeMesh
        The undeformed mesh.
    displacement : (N, 3) ndarray
        Displacement of the N nodes, in mm.

    Returns
    -------
    (3,) ndarray
        Mean displacement in mm.
    """
    faces = mesh.faces[mesh.face_region == REGIONS["roof"]]
    tangents = [np.einsum("qa,fai->fqi", slopes, mesh.points[faces]) for slopes in shape_slopes(_MIDPOINTS)]
    area = np.linalg.norm(np.cross(*tangents), axis=2)
    displacements = np.einsum("qa,fai->fqi", shape_functions(_MIDPOINTS), displacement[faces])
    return np.einsum("fq,fqi->i", area, displacements) / area.sum()


def _finer_change(case: ExtremeCase, state: State | None) -> float:
    """Relative change of the roofs' mean displacement on the finer mesh; NaN if the load path on that mesh fails."""
    assert state is not None
    size = case.mesh_size / FINER
    try:
        (finer,) = load_path(case.pad, case.material, [case.value], load=case.load, mesh_size=size)
    except ComputationError:
        return math.nan
    coarse_roof, finer_roof = (mean_roof(s.mesh, s.displacement) for s in (state, finer))
    return float(np.linalg.norm(finer_roof - coarse_roof) / np.linalg.norm(coarse_roof))


def _listed(value: np.ndarray) -> str:
    """A load or a position as text, with four digits: one number, or several numbers in parentheses."""
    numbers = ", ".join(f"{number:.4g}" for number in value + 0.0)
    return f"({numbers})" if len(value) > 1 else numbers
