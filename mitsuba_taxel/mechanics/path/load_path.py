"""The deformed pad at any load, by way of one path that everybody shares.

The path to a force F is 0 -> (0, 0, Fz) -> F: the normal segment first, then the tangential one, as in the paper's
procedure and on the bench. Its nodes depend on pad, material, load and mesh alone, so that a state is the same to the
bit whoever asks for it, with whatever others, in any order. A load that differs from another by a mirror of the pad has
the mirrored state, to the bit.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, lru_cache, partial
from textwrap import shorten
from typing import get_args

import numpy as np

from mitsuba_taxel.base.arguments import check_progress, is_number, refusal, require
from mitsuba_taxel.base.convergence import COARSENING, ORDER, TYPICAL_ERROR
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.geometry.mirror import MIRRORS, Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.self_contact import Contact, ContactTest
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE, Load, PlateDisplacement, keeps
from mitsuba_taxel.mechanics.elements.memory import memory_for
from mitsuba_taxel.mechanics.elements.nodal_forces import board_force
from mitsuba_taxel.mechanics.elements.solvers import available_solvers
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.path import cache
from mitsuba_taxel.mechanics.path.equilibrium import RESIDUAL_TOLERANCE, LoadedPad, natural_step
from mitsuba_taxel.mechanics.path.load_segment import INTERPOLATION_TOLERANCE, Interpolated, LoadSegment
from mitsuba_taxel.mechanics.path.obstacles import Obstacles
from mitsuba_taxel.mechanics.results.roof_error import NO_ERROR, RoofComparison, RoofError, size_ratio
from mitsuba_taxel.pads.pad import Pad
from mitsuba_taxel.pads.pad_file import PadFile

COARSEST = 0.35
"""Size of the coarsest elements that `mesh_size_for` tries, relative to the pad's height."""
SIZES = 9
"""How many sizes it tries, each 1 / sqrt(2) of the one before."""
MOST_ELEMENTS_TRIED = 100_000
"""A mesh of more is not tried: without symmetry it takes some 10 GB to solve."""

FEW_STATES = 100
MOST_BYTES = 4 * 2**30
"""Of the states that are returned at once; a few are never refused."""

FINER = (COARSENING**-0.75, COARSENING**-1, COARSENING**-1.5, COARSENING**-2)
"""Sizes of a second mesh, relative to the first's, that are tried where one of twice the size does not tell the error:
thin walls and curves leave the mesher little choice, and a coarse pad may not bear a load."""
LEAST_RATIO = 1.2
"""Of the sizes that two meshes have in fact, for their difference to tell the error of one."""
MOST_ELEMENTS_COMPARED = 250_000
"""A finer second mesh of more is not tried."""

_SECOND_MESH = "a second mesh"
_LOCK = threading.RLock()

Start = Callable[[], tuple[np.ndarray, np.ndarray]]
Touch = Callable[[LoadSegment, LoadedPad], tuple[float, Contact] | None]


@dataclass(frozen=True, eq=False)
class State(Displayed):
    """A deformed pad.

    Attributes
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    material : Material
        What it is made of.
    load : Load
        How it is loaded.
    value : (3,) ndarray
        N or mm, or (1,) MPa: of the load.
    displacement : (N, 3) ndarray
        Of each node, in mm.
    pressure : (corners,) ndarray
        In MPa, positive in tension.
    min_jacobian : float
        Least volume ratio J at the ends of the interval that the state lies in.
    residual : float
        Largest out-of-balance force there, relative to the load.
    newton_iterations : int
        Iterations of the last solve.
    stability_checked : bool
        Whether the solver gave the inertia that stability was judged by.
    error : RoofError or None
        Estimated discretisation error at the roofs; None where it is not known, because no second mesh, coarser or
        finer, can be made or loaded so far, or memory does not suffice for it.
    seconds : float
        That the equilibria on the way to it took to solve, on both meshes, and whenever that was.
    deviations : (2, N, 3) ndarray or None
        In mm, of the displacement on elements of twice the size from this one on roofs and sides of the cells,
        extrapolated from those of the second mesh, 0 elsewhere: what goes along the displacement, and what is left;
        None where that is not known.
    force_error : float
        In N, of the board's force on the pad where a plate is moved, and 0 where a force is given; not a number where
        that is not known.
    """

    mesh: VolumeMesh
    material: Material
    load: Load
    value: np.ndarray
    displacement: np.ndarray
    pressure: np.ndarray
    min_jacobian: float
    residual: float
    newton_iterations: int
    stability_checked: bool
    error: RoofError | None
    seconds: float = 0.0
    deviations: np.ndarray | None = None
    force_error: float = math.nan


def load_path(
    pad: Pad | PadFile,
    material: Material,
    values: Sequence[Sequence[float]] | np.ndarray,
    *,
    load: Load = SPREAD_FORCE,
    mesh_size: float | None = None,
    mesh_tolerance: float | None = None,
    obstacles: np.ndarray | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[State]:
    """Deformed states of a pad under each of the ``values`` of a load.

    Parameters
    ----------
    values : Sequence[Sequence[float]] or ndarray
        (S, 3) forces in N or displacements in mm, compression is z < 0; or (S, 1) pressures in MPa.
    mesh_size : float, optional
        Size of the finite elements in mm; by default the pad's own `default_mesh_size`.
    mesh_tolerance : float, optional
        Instead of a size, the relative error of the roofs' displacement under a small load that the size is chosen for;
        see :func:`mesh_size_for`.
    obstacles : (K, 3, 3) ndarray, optional
        In mm, corners of the triangles of closed surfaces that the pad must not touch, in its frame.
    progress : Callable[[int, int], None], optional
        Called with the number of states done and the number of all.

    Raises
    ------
    InputError
        for values that are not finite or too many to be held, a mesh size or a tolerance that is not allowed, or
        obstacles that the undeformed pad touches.
    ComputationError
        naming the value at which the path ends, because the pad cannot be loaded further, or touches itself, the
        board or an obstacle; or if memory does not suffice.
    """
    require("pad", pad, (Pad, PadFile), "a Pad or a PadFile")
    require("material", material, Material, "a Material, such as NeoHookean,")
    require("load", load, get_args(Load), "a load, such as SpreadForce,")
    check_progress(progress)
    rows = _checked(values, load)
    if obstacles is not None:
        obstacles = _checked_triangles(obstacles)
    states = []
    with _LOCK:
        path = _path(pad, material, load, _size(pad, material, load, mesh_size, mesh_tolerance))
        _check_room(len(rows), path)
        for done, value in enumerate(rows, start=1):
            with memory_for(f"a pad of finite elements of {path.mesh_size:.3g} mm"):
                states.append(path.state(value, obstacles))
            if progress is not None:
                progress(done, len(rows))
    return states


def _check_room(states: int, path: _Path) -> None:
    """Raise `InputError` if so many states cannot be held at once."""
    if states <= FEW_STATES:
        return
    most = MOST_BYTES // (3 * path.mesh.points.nbytes)  # displacement and deviations
    if states > most:
        raise InputError(
            f"{states} values of a load are not allowed: at most {most} states of this pad are held at once; ask for "
            "them one after the other."
        )


def mesh_size_for(pad: Pad | PadFile, material: Material, load: Load, tolerance: float) -> float:
    """The coarsest of a row of mesh sizes [mm] whose error is within ``tolerance`` under a small load.

    The error is that of :class:`RoofError`, ``relative``, of the change from rest under a small normal load, and under
    a small tangential one where the load has a direction. Under larger loads it may be larger, and is stated.

    Raises
    ------
    InputError
        if the tolerance is no number between 0 and 1, or out of reach.
    ComputationError
        if the pad cannot be meshed.
    """
    if not 0 < tolerance < 1:
        raise InputError(f"mesh_tolerance = {tolerance:g} is not allowed: above 0 and below 1 is needed.")
    error = math.inf
    with _LOCK:
        size = COARSEST * _height(pad)
        for _ in range(SIZES):
            path = _path(pad, material, load, size)
            if len(path.mesh.tets) > MOST_ELEMENTS_TRIED:
                break
            error = path.small_load_error
            if error <= tolerance:
                return size
            size /= math.sqrt(2)
    reached = f"{error:.2g} is what the finest mesh tried, of {size * math.sqrt(2):.2g} mm, reaches"
    if math.isinf(error):
        reached = f"no mesh of at most {MOST_ELEMENTS_TRIED} elements tells its error"
    raise InputError(f"mesh_tolerance = {tolerance:g} is not allowed: {reached}.")


def _height(pad: Pad | PadFile) -> float:
    return pad.height if isinstance(pad, Pad) else float(np.ptp(pad.mesh(pad.default_mesh_size).points[:, 2]))


def _size(pad: Pad | PadFile, material: Material, load: Load, size: float | None, tolerance: float | None) -> float:
    for name, value in (("mesh_size", size), ("mesh_tolerance", tolerance)):
        if not (value is None or is_number(value)):
            raise refusal(name, value, "a finite number is needed")
    if size is not None and tolerance is not None:
        raise InputError(f"mesh_size = {size:g} and mesh_tolerance = {tolerance:g} are given: only one is allowed.")
    if tolerance is not None:
        return mesh_size_for(pad, material, load, tolerance)
    return pad.default_mesh_size if size is None else float(size)


def _checked(values: Sequence[Sequence[float]] | np.ndarray, load: Load) -> np.ndarray:
    """The values as an array (S, components); raises `InputError`."""
    try:
        rows = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        rows = np.empty(0)
    wanted = "three finite numbers are" if load.components == 3 else "one finite number is"
    if rows.ndim != 2 or rows.shape[1] != load.components:
        shown = shorten(repr(values), 100, placeholder=" ...]")
        raise InputError(f"{load.quantity} values = {shown} are not allowed: rows of {wanted} needed.")
    wrong = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(wrong):
        shown = f"{load.quantity} values[{wrong[0]}] = {rows[wrong[0]].tolist()}"
        raise InputError(f"{shown} are not allowed: {wanted} needed.")
    return rows


def _checked_triangles(obstacles: object) -> np.ndarray:
    """The corners (K, 3, 3) as numbers; raises `InputError`."""
    try:
        corners = np.asarray(obstacles, dtype=float)
    except (TypeError, ValueError, OverflowError):
        corners = np.empty(0)
    if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not np.all(np.isfinite(corners)):
        raise refusal("obstacles", obstacles, "an array (K, 3, 3) of finite corners of triangles is needed")
    return corners


class _Path:
    """Mesh and segments of one pad of one material under one kind of load, kept on disk and in memory.

    One that another is compared with is not ``judged``: it may be unstable where it does not show in that.
    """

    def __init__(self, pad: Pad | PadFile, material: Material, load: Load, mesh_size: float, judged: bool) -> None:
        self.pad, self.material, self.load, self.mesh_size, self.judged = pad, material, load, mesh_size, judged
        self._identity = [pad.identity, mesh_size]
        self._segments: dict[tuple[float, ...], LoadSegment] = {}
        self._compared: dict[float, tuple[_Path, RoofComparison] | None] = {}

    @cached_property
    def mesh(self) -> VolumeMesh:
        name = cache.key("mesh", self._identity)
        with cache.alone(name):
            arrays = cache.load(name)
            if arrays is None:
                mesh = self.pad.mesh(self.mesh_size)
                cache.store(name, vars(mesh))
                return mesh
        return VolumeMesh(**arrays)

    @cached_property
    def images(self) -> dict[Mirror, np.ndarray]:
        """The mirrors that leave mesh and load's distribution as they are."""
        images = node_images(self.mesh)
        return {mirror: image for mirror, image in images.items() if keeps(self.load, self.mesh, image)}

    @cached_property
    def _contact(self) -> ContactTest:
        return ContactTest(self.mesh)

    def _obstacles(self, triangles: np.ndarray, mirrors: list[Mirror]) -> Obstacles:
        """What is known of obstacles, which ``mirrors`` take where the segments are; of the last few."""
        return _in_the_way(self, np.asarray(triangles, dtype=float).tobytes(), tuple(mirrors))

    @cached_property
    def _step(self) -> float:
        return natural_step(self.mesh, self.material, self.load)

    def state(self, value: np.ndarray, obstacles: np.ndarray | None = None) -> State:
        """The deformed pad under ``value``, on the way to which it must not touch ``obstacles``."""
        used = []
        turned = value
        for mirror in MIRRORS:
            if len(value) == 3 and mirror.side(turned) < 0 and mirror in self.images:
                turned = mirror.image(turned)
                used.append(mirror)
        in_the_way = None if obstacles is None else self._obstacles(obstacles, used)
        displacement, pressure, at = self._canonical(turned, used, in_the_way)
        error, deviations, force_error, seconds = self._error(turned, displacement, pressure)
        for mirror in reversed(used):
            image = self.images[mirror]
            displacement, pressure = mirror.image(displacement[image]), pressure[image[: len(pressure)]]
            deviations = None if deviations is None else mirror.image(deviations[:, image])
        figures = (at.min_jacobian, at.residual, at.iterations, at.stability_checked, error, seconds + at.seconds)
        shape = (self.mesh, self.material, self.load, np.array(value), displacement, pressure)
        return State(*shape, *figures, deviations, force_error)

    def _canonical(
        self, value: np.ndarray, mirrors: list[Mirror], obstacles: Obstacles | None
    ) -> tuple[np.ndarray, np.ndarray, Interpolated]:
        """Displacement, pressure and figures under a value on the kept side of all mirrors of the pad.

        ``mirrors`` are those that took it there, and the obstacles too.
        """
        found = np.zeros_like(self.mesh.points), np.zeros(self.mesh.corner_count)
        if not value.any():
            return *found, Interpolated(np.zeros(0), 1.0, 0.0, 0, True, 0.0)
        start, seconds = partial(_at_rest, found), 0.0
        for segment, s in self._segments_to(value):
            pad = self._pad_for(segment.origin, segment.direction)
            touch = obstacles.first if obstacles else _nothing
            if not segment.reaches(s):
                self._extend(segment, pad, s, start, touch)
            touched = touch(segment, pad)
            if touched and touched[0] < min(s, segment.limit):
                free, contact = touched
                end = segment.value(free), f"touches {contact.what}", np.array(contact.place)
                raise ComputationError(_end(*end, self.load, mirrors))
            if not segment.reaches(s):
                raise ComputationError(
                    _end(segment.value(segment.limit), segment.reason, segment.place, self.load, mirrors)
                )
            at = segment.at(s)
            seconds += at.seconds
            found = pad.split(at.unknowns)
            start = partial(_in_balance, pad, at.unknowns, segment.value(s))
        return *found, replace(at, seconds=seconds)

    def _error(
        self, value: np.ndarray, displacement: np.ndarray, pressure: np.ndarray
    ) -> tuple[RoofError | None, np.ndarray | None, float, float]:
        """Errors of a canonical state by the same path on another mesh, and that one's seconds.

        They are the error and the deviations of the displacement, and the error of the board's force.
        """
        if not value.any():
            return NO_ERROR, np.zeros_like(displacement), 0.0, 0.0
        for second, comparison in self._comparisons():
            try:
                with memory_for(_SECOND_MESH):
                    other, there, at = second._canonical(value, [], None)
            except ComputationError:
                continue  # its path ends before this load, or memory does
            force_error = 0.0
            if isinstance(self.load, PlateDisplacement):
                shapes = (self.mesh, displacement, pressure), (second.mesh, other, there)
                force_error = comparison.force_error(*(board_force(m, self.material, u, p) for m, u, p in shapes))
            return (
                comparison.error(displacement, other),
                comparison.deviations(displacement, other),
                force_error,
                at.seconds,
            )
        return None, None, math.nan, 0.0

    def _comparisons(self) -> Iterator[tuple[_Path, RoofComparison]]:
        """The paths on other elements that may tell the error, and how they are compared; the first that can, does."""
        start = min(self.mesh_size, self.pad.default_mesh_size)  # larger ones may all give the same mesh
        for size in (COARSENING * self.mesh_size, *(finer * start for finer in FINER)):
            if size not in self._compared:
                self._compared[size] = self._second(size)
            second = self._compared[size]
            if second is not None:
                yield second

    def _second(self, mesh_size: float) -> tuple[_Path, RoofComparison] | None:
        """The path on elements of another size; None if there is no such mesh, or it differs too little in fact."""
        second = _path(self.pad, self.material, self.load, mesh_size, judged=False)
        try:
            with memory_for(_SECOND_MESH):
                ratio = size_ratio(self.mesh, second.mesh)
        except (ComputationError, InputError):
            return None
        if max(ratio, 1 / ratio) < LEAST_RATIO or len(second.mesh.tets) > MOST_ELEMENTS_COMPARED:
            return None
        relative_size = min(self.mesh_size / self.pad.default_mesh_size, COARSENING)  # or all are as coarse as can be
        return second, RoofComparison(self.mesh, second.mesh, TYPICAL_ERROR * relative_size**ORDER)

    @property
    def small_load_error(self) -> float:
        """Relative error of the roofs' change from rest under small loads; infinite where it is not known."""
        for second, comparison in self._comparisons():
            responses = zip(self._small_responses, second._small_responses, strict=True)
            return max(comparison.error(here, other).relative for here, other in responses)
        return math.inf

    @cached_property
    def _small_responses(self) -> list[np.ndarray]:
        """(N, 3) each: change of the displacement from rest with a normal load, and with a tangential one."""
        size = self.load.components
        directions = [np.eye(size)[-1], np.eye(size)[0]][: 1 if size == 1 else 2]
        return [self._rest_rate(direction) for direction in directions]

    def _rest_rate(self, direction: np.ndarray) -> np.ndarray:
        pad = self._pad_for(np.zeros_like(direction), direction)
        at_rest, linearised = pad.solve(np.zeros(pad.unknowns), np.zeros_like(direction))
        return pad.split(pad.rate(linearised, at_rest.unknowns, direction))[0]

    def _segments_to(self, value: np.ndarray) -> list[tuple[LoadSegment, float]]:
        """The segments of the path to ``value``, and how far along each it goes."""
        if len(value) == 1:
            return [(self._segment(np.zeros(1), np.sign(value)), abs(value[0]))]
        normal, tangential = value[2], float(np.hypot(value[0], value[1]))
        segments = []
        if normal:
            segments.append((self._segment(np.zeros(3), np.array([0.0, 0.0, np.sign(normal)])), abs(normal)))
        if tangential:
            direction = np.round(np.array([value[0], value[1], 0.0]) / tangential, 12)
            segments.append((self._segment(np.array([0.0, 0.0, normal]), direction), tangential))
        return segments

    def _segment(self, origin: np.ndarray, direction: np.ndarray) -> LoadSegment:
        index = (*origin, *direction)
        if index not in self._segments:
            segment = self._segments[index] = LoadSegment(origin, direction, self._step, self.judged)
            self._take_stored(segment)
        return self._segments[index]

    def _pad_for(self, origin: np.ndarray, direction: np.ndarray) -> LoadedPad:
        """The part of the pad that a segment needs: that between the mirrors which leave its loads as they are."""
        path = np.stack([origin, direction])
        mirrors = tuple(m for m in self.images if path.shape[1] == 1 or np.array_equal(m.image(path), path))
        return _loaded_pad(self, mirrors)

    def _extend(self, segment: LoadSegment, pad: LoadedPad, s: float, start: Start, touch: Touch) -> None:
        """Solve a segment as far as ``s``, or the pad touches something, unless another process has meanwhile.

        ``start`` is the state at its origin.
        """
        with cache.alone(self._segment_name(segment)):
            self._take_stored(segment)
            before = len(segment.nodes), segment.limit
            try:
                segment.extend(
                    pad, s, lambda: pad.gather(*start()), self._contact, lambda: touch(segment, pad) is not None
                )
            finally:
                if (len(segment.nodes), segment.limit) != before:
                    cache.store(self._segment_name(segment), segment.arrays())

    def _take_stored(self, segment: LoadSegment) -> None:
        arrays = cache.load(self._segment_name(segment))
        if arrays is not None and len(arrays["s"]) >= len(segment.nodes):
            segment.restore(arrays)

    def _segment_name(self, segment: LoadSegment) -> str:
        material = [_name_of(self.material), *(getattr(self.material, name) for name in self.material.parameters)]
        load = [_name_of(self.load), asdict(self.load)]
        numerics = [segment.step, segment.judged, RESIDUAL_TOLERANCE, INTERPOLATION_TOLERANCE, available_solvers()[0]]
        return cache.key(
            "segment", self._identity, material, load, numerics, segment.origin.tolist(), segment.direction.tolist()
        )


def _at_rest(state: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return state


def _in_balance(pad: LoadedPad, near: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and pressure in balance near the unknowns of an interpolated state."""
    return pad.split(pad.balance(near, value))


def _nothing(segment: LoadSegment, pad: LoadedPad) -> None:
    """What a path touches that nothing stands in the way of."""


def _end(value: np.ndarray, reason: str, place: np.ndarray, load: Load, mirrors: list[Mirror]) -> str:
    """What to say of a segment that ends too early, for the load that ``mirrors`` turned into the segment's."""
    for mirror in reversed(mirrors):
        value, place = mirror.image(value), mirror.image(place)
    where = f" near ({_listed(place)}) mm, which is outside the model" if np.all(np.isfinite(place)) else ""
    shown = f"({_listed(value)})" if len(value) == 3 else _listed(value)
    return f"the pad {reason}{where}: the load path ends at {load.quantity} = {shown} {load.unit}."


def _name_of(part: object) -> str:
    return f"{type(part).__module__}.{type(part).__qualname__}"


def _listed(numbers: np.ndarray) -> str:
    return ", ".join(f"{number:.4g}" for number in numbers)


@lru_cache(maxsize=16)
def _path(pad: Pad | PadFile, material: Material, load: Load, mesh_size: float, judged: bool = True) -> _Path:
    return _Path(pad, material, load, mesh_size, judged)


@lru_cache(maxsize=8)
def _in_the_way(path: _Path, triangles: bytes, mirrors: tuple[Mirror, ...]) -> Obstacles:
    return Obstacles(path.mesh, np.frombuffer(triangles).reshape(-1, 3, 3), mirrors)


@lru_cache(maxsize=4)  # a normal and a tangential segment, and those of the coarser mesh: matrices take memory
def _loaded_pad(path: _Path, mirrors: tuple[Mirror, ...]) -> LoadedPad:
    return LoadedPad(path.mesh, path.material, path.load, mirrors, path.images)
