"""Estimated errors of a load path, from the same path on a second mesh."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.convergence import COARSENING, ORDER, TYPICAL_ERROR
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.processes.activities import activity
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.continuation.indenter_depth import DOWN, under_force
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath
from mitsuba_taxel.mechanics.continuation.path_nodes import Interpolated
from mitsuba_taxel.mechanics.continuation.state import NO_ERROR, State, StateComparison
from mitsuba_taxel.mechanics.elements.loads import normal_part
from mitsuba_taxel.mechanics.elements.memory import memory_for
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import RESIDUAL_TOLERANCE
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected
from mitsuba_taxel.mechanics.errors.roof_error import RoofComparison, size_ratio, top_ratio
from mitsuba_taxel.mechanics.errors.shorter_reach import with_reach
from mitsuba_taxel.mechanics.locate import carried
from mitsuba_taxel.mechanics.memory_of_pads import refuse_too_large

FINER = (COARSENING**-0.75, COARSENING**-1, COARSENING**-1.5, COARSENING**-2)
"""Sizes of a second mesh, relative to the first, that are tried where a mesh of twice the size gives no error estimate:
thin walls and curves limit the mesher, and a coarse pad may not bear a load. For elements larger than the default, the
default size is tried first, and these ratios are relative to it."""
LITTLE_FINER = COARSENING**-0.5
"""Relative size that is tried first under an indenter, where elements are already small and numerous."""
BETWEEN = 0.8
"""Factor on the element size of a second mesh, if the elements of the first are larger than the default. Powers of this
factor are tried before the default size, if the default size has more than :data:`COSTLY` times as many elements."""
COSTLY = 8.0
LEAST_RATIO = 1.2
"""Least actual ratio of element sizes of two meshes for an error estimate."""
COARSEST = (COARSENING, 1.5 * COARSENING, 2 * COARSENING)
"""Element sizes of a coarser second mesh, relative to the first mesh. They are tried again with
:data:`LEAST_RATIO_OF_COARSER` if a finer mesh does not fit into memory or does not bear the load."""
LITTLE_COARSER = COARSENING**0.5
"""Relative size that is tried before :data:`COARSEST` under an indenter, whose contact a mesh of twice the size may not
resolve."""
LEAST_RATIO_OF_COARSER = 1.1
"""Least ratio of element sizes for these coarser meshes. The estimate is then rough, up to four times the true error,
but better than none."""
MOST_ELEMENTS_COMPARED = 250_000
"""Largest number of elements of a second mesh that is finer than the first."""

Result = TypeVar("Result")


class SecondMeshes:
    """Load paths of the same pad on meshes with elements of other sizes, for an estimate of the error of a path.

    Parameters
    ----------
    path : PadPath
        The path.
    """

    def __init__(self, path: PadPath) -> None:
        self._path = path
        self._known: dict[tuple[float, float], tuple[PadPath, RoofComparison] | None] = {}

    def __iter__(self) -> Iterator[tuple[PadPath, RoofComparison]]:
        path = self._path
        start = min(path.mesh_size, path.pad.default_mesh_size)  # larger sizes may all give the same mesh
        finer = FINER if path.load.indenter is None else (LITTLE_FINER, *FINER)
        coarser = path.judge.mesh_size if path.judge else COARSENING * path.mesh_size
        default = [start] if start < path.mesh_size else []
        yield from self._of_sizes([coarser])
        if default and self._is_costly(start):
            count = math.ceil(math.log(start / path.mesh_size) / math.log(BETWEEN))
            yield from self._of_sizes(BETWEEN**power * path.mesh_size for power in range(1, count))
        yield from self._of_sizes([*default, *(relative_size * start for relative_size in finer)])

    def coarsest(self) -> Iterator[tuple[PadPath, RoofComparison]]:
        """Paths on coarser meshes whose element sizes differ less from that of the path. They are used if no other mesh
        bears the load and fits into memory.
        """
        relative_sizes = COARSEST if self._path.load.indenter is None else (LITTLE_COARSER, *COARSEST)
        sizes = [relative_size * self._path.mesh_size for relative_size in relative_sizes]
        tried = [size for size in sizes if self._known.get((size, LEAST_RATIO))]
        yield from self._of_sizes([size for size in sizes if size not in tried], LEAST_RATIO_OF_COARSER)

    def _of_sizes(
        self, sizes: Iterable[float], least_ratio: float = LEAST_RATIO
    ) -> Iterator[tuple[PadPath, RoofComparison]]:
        """Paths on meshes with the given element sizes in mm, if the sizes differ enough from that of the path."""
        for size in sizes:
            if (size, least_ratio) not in self._known:
                self._known[size, least_ratio] = self._compared_with(size, least_ratio)
            second = self._known[size, least_ratio]
            if second is not None:
                yield second

    def _is_costly(self, mesh_size: float) -> bool:
        """Whether a mesh with this element size in mm has many times as many elements as the path."""
        path = self._path
        try:
            with memory_for("a second mesh"):
                refuse_too_large(path.pad, mesh_size, path.load)
                return len(path.on_elements(mesh_size).mesh.tets) > COSTLY * len(path.mesh.tets)
        except (ComputationError, InputError):
            return True

    def first(self, compare: Callable[[PadPath, RoofComparison], Result]) -> Result | None:
        """Call ``compare`` for the first other mesh that fits into memory and on which the pad bears the load. Returns
        the result, or None if there is no such mesh.

        Parameters
        ----------
        compare : Callable[[PadPath, RoofComparison], Result]
            Solves the load on the path on another mesh, and compares; raises `ComputationError` where it does not bear
            the load.
        """
        for meshes in (self, self.coarsest()):
            for second, comparison in meshes:
                size = second.mesh_size
                try:
                    with memory_for("a second mesh"), activity(f"solving a second mesh, elements of {size:.3g} mm"):
                        return compare(second, comparison)
                except ComputationError:  # its path ends before this load, or memory does not suffice
                    if size < self._path.mesh_size:
                        break  # finer meshes would fail too, after more time
        return None

    def comparison(self, value: np.ndarray, displacement: np.ndarray, pressure: np.ndarray) -> StateComparison:
        """Compare a state with the state under the same load on another mesh: the first mesh on which the pad bears the
        load.

        Parameters
        ----------
        value : ndarray
            Value of the load.
        displacement : (N, 3) ndarray
            Displacement of the state, mm.
        pressure : (corners,) ndarray
            Pressure of the state, MPa.

        Returns
        -------
        StateComparison
            Comparison with unknown errors if no other mesh bears the load.
        """
        path = self._path
        if not value.any():
            return StateComparison(NO_ERROR, partial(np.zeros, (2, *displacement.shape)), 0.0, 0.0)

        def compare(second: PadPath, comparison: RoofComparison) -> StateComparison:
            # Second meshes whose stability is not tested would not buckle.
            if path.segments.buckled_at(value) is not None:
                second = path.on_elements(second.mesh_size, judged=True)
            moved = value if path.load.driven is None else path.driven_to(value, None)
            on_second, there, at, moved = carried_to(second, path.mesh, value, displacement, pressure, moved)
            (second if path.load.driven is None else second.driven).refuse_unresolved(moved, on_second)
            force_error = relative_force_error = 0.0
            if path.load.gives_displacement:
                forces = [path.force(value, displacement, pressure), second.force(value, on_second, there)]
                force_error = comparison.force_error(*forces)
                relative_force_error = share_of(force_error, forces[0])
            deviations = partial(comparison.deviations, displacement, on_second, relative_force_error)
            return StateComparison(comparison.error(displacement, on_second), deviations, force_error, at.seconds)

        result = self.first(compare) or StateComparison()
        return with_reach(path, result, value, displacement, pressure) if path.load.self_contact else result

    def _compared_with(self, mesh_size: float, least_ratio: float) -> tuple[PadPath, RoofComparison] | None:
        """Load path with another element size, and its comparison with this path; None if it cannot be meshed, or if
        the actual element sizes differ too little."""
        path = self._path
        judge = path.judge
        second = judge if judge and judge.mesh_size == mesh_size else path.on_elements(mesh_size)
        try:
            with memory_for("a second mesh"):
                refuse_too_large(path.pad, mesh_size, path.load)
                ratio = size_ratio(path.mesh, second.mesh)
        except (ComputationError, InputError):
            return None
        most = max(MOST_ELEMENTS_COMPARED, len(path.mesh.tets))
        if max(ratio, 1 / ratio) < least_ratio or len(second.mesh.tets) > most:
            return None
        least = self.typical(TYPICAL_ERROR)
        here, there = path.images, second.images
        images = {mirror: (here[mirror], there[mirror]) for mirror in here if mirror in there}
        return second, RoofComparison(path.mesh, second.mesh, least, max(least, self._typical_at_top), images)

    @property
    def _typical_at_top(self) -> float:
        """Typical relative error of a force. It is the error on elements of the default size, scaled by the size of the
        elements at the top relative to those of the mesh on which stability is tested; 0 without such a mesh.
        """
        judge = self._path.judge
        return 0.0 if judge is None else TYPICAL_ERROR * top_ratio(judge.mesh, self._path.mesh) ** ORDER

    def typical(self, error: float) -> float:
        """Estimate of the error with the elements of this path, from an ``error`` that is typical of elements of the
        default size.
        """
        relative_size = min(self._path.mesh_size / self._path.pad.default_mesh_size, COARSENING)
        return error * relative_size**ORDER  # larger elements may all have the coarsest possible mesh

    @property
    def small_load_error(self) -> float:
        """Relative error of the roofs' displacement under small loads; infinite if it is unknown."""
        for second, comparison in self:
            responses = zip(_small_responses(self._path), _small_responses(second), strict=True)
            return max(comparison.error(here, there).relative for here, there in responses)
        return math.inf


@kept(16)
def _small_responses(path: PadPath) -> list[np.ndarray]:
    """Derivatives of the displacement at rest with respect to a normal and to a tangential load, each (N, 3)."""
    responses, size = [], path.load.components
    for direction in [normal_part(np.ones(size)), np.eye(size)[0]][: 1 if size == 1 else 2]:
        zero = np.zeros_like(direction)
        pad = path.segments.pad_for(zero, direction)
        at_rest, linearised = pad.solve(np.zeros(pad.unknowns), zero)
        responses.append(pad.split_rate(pad.rate(linearised, at_rest.unknowns, direction, zero))[0])
    return responses


@kept(16)
def second_meshes(path: PadPath) -> SecondMeshes:
    """The meshes of other element sizes for a load path; all callers share one object."""
    return SecondMeshes(path)


def compared(path: PadPath, state: State) -> State:
    """A copy of a state with its error, which is computed on a second mesh when it is first read.

    Parameters
    ----------
    path : PadPath
        The path.
    state : State
        State without its error.

    Returns
    -------
    State
        State with its error.
    """
    return replace(state, second_mesh=partial(_comparison, path, state))


def _comparison(path: PadPath, state: State) -> StateComparison:
    """Errors of a state from a second mesh. They are computed for the canonical state, the mirror image that is solved,
    and reflected back.
    """
    with path.lock:
        path = path.bearing(state.value)
        value, mirrors = path.turned(state.value)
        canonical = path.mirrored(state.displacement, state.pressure, mirrors)
        comparison = second_meshes(path).comparison(value, *canonical)
    return comparison._replace(deviate=comparison.deviate and partial(_mirrored, path, comparison.deviate, mirrors))


def _mirrored(path: PadPath, deviate: Callable[[], np.ndarray], mirrors: list[Mirror]) -> np.ndarray:
    """Deviations (2, N, 3) of a state, from those of its canonical state (the mirror image that is solved): reflected
    in the ``mirrors``.
    """
    deviations = deviate()
    for mirror in reversed(mirrors):
        deviations = mirror.image(deviations[:, path.images[mirror]])
    return deviations


def share_of(error: float, force: np.ndarray) -> float:
    """Error of a force, relative to the force.

    Parameters
    ----------
    error : float
        Error in N.
    force : (3,) ndarray
        Force in N.

    Returns
    -------
    float
        Relative error; 1 if the force is 0 and the error is not.
    """
    size = float(np.linalg.norm(force))
    return error / size if size else float(error > 0)


def carried_to(
    path: PadPath,
    mesh: VolumeMesh,
    value: np.ndarray,
    displacement: np.ndarray,
    pressure: np.ndarray,
    moved: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, Interpolated, np.ndarray]:
    """Solve the state under a load on the elements of another load path. Under an indenter, the state on the first mesh
    is the initial guess.

    Without friction a state does not depend on the path that leads to it.

    Parameters
    ----------
    path : PadPath
        Path of the state to be solved.
    mesh : VolumeMesh
        The other mesh.
    value : ndarray
        Value of the load.
    displacement : (N, 3) ndarray
        Displacement on the other mesh, mm.
    pressure : (corners,) ndarray
        Pressure on the other mesh, MPa.
    moved : (3,) ndarray, optional
        Displacement in mm of the indenter on the other mesh; by default the value.

    Returns
    -------
    displacement : (N', 3) ndarray
        Displacement of the state, mm.
    pressure : (corners',) ndarray
        Pressure of the state, MPa.
    figures : Interpolated
        Figures with the seconds of its solution.
    moved : ndarray
        Displacement of the indenter in mm, which under a force differs from that on the other mesh; for other loads,
        the value.
    """
    on, moved = (path, value) if path.load.driven is None or moved is None else (path.driven, moved)
    if on.load.moved_indenter is None or path.load.self_contact:  # walls of an interpolated state may intersect
        return _on_path(path, value)
    name = cache.key("jump", *path.key_parts, RESIDUAL_TOLERANCE, _digest(mesh, displacement), value.tolist())
    with cache.alone(name):
        arrays = cache.load(name)
        if arrays is None:
            began, pad = time.perf_counter(), on.segments.pad_for(np.zeros(3), moved)
            try:
                start = pad.gather(*carried(mesh, displacement, pressure, path.mesh, path.mesh_size))
                if on is path:
                    unknowns = pad.solve_linearised(start, value)[0].unknowns
                else:
                    assert isinstance(pad, IndentedPad)  # loads by an indenter
                    node = under_force(pad, -value[2], -moved[2], start, (0.0, math.inf))
                    unknowns, moved = node.unknowns, node.s * DOWN
            except (InputError, Rejected):
                return _on_path(path, value)
            arrays = {"unknowns": unknowns, "moved": moved, "seconds": np.array(time.perf_counter() - began)}
            cache.store(name, arrays)
    seconds, pad = float(arrays["seconds"]), on.segments.pad_for(np.zeros(3), moved)
    figures = Interpolated(
        unknowns=arrays["unknowns"],
        min_jacobian=math.nan,
        residual=math.nan,
        iterations=0,
        stability_checked=True,
        seconds=seconds,
    )
    return *pad.split(arrays["unknowns"]), figures, arrays["moved"]


def _on_path(path: PadPath, value: np.ndarray) -> tuple[np.ndarray, np.ndarray, Interpolated, np.ndarray]:
    """State under the canonical load, the mirror image that is solved, and the value of that load; under a force on an
    indenter, the displacement of the indenter instead of the value.
    """
    state = path.canonical(value, [], None)
    return *state, value if path.load.driven is None else path.driven_to(value, None)


def _digest(mesh: VolumeMesh, displacement: np.ndarray) -> str:
    return hashlib.sha256(mesh.points.tobytes() + displacement.tobytes()).hexdigest()
