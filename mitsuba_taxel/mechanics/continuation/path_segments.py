"""Segments of load paths, and the branches on which paths continue after buckling."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact, ContactTest
from mitsuba_taxel.mechanics.continuation.buckled_branch import BuckledBranch
from mitsuba_taxel.mechanics.continuation.load_segment import Followed, LoadSegment
from mitsuba_taxel.mechanics.continuation.onset_of_buckling import find_onset, is_kept
from mitsuba_taxel.mechanics.continuation.path_problem import PathProblem
from mitsuba_taxel.mechanics.elements.loads import mirrored_value, normal_part
from mitsuba_taxel.mechanics.elements.solvers import available_solvers
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import RESIDUAL_TOLERANCE, LoadedPad
from mitsuba_taxel.mechanics.equilibrium.natural_step import TICKS
from mitsuba_taxel.mechanics.equilibrium.pad_parts import loaded_pad

LONGER_PRESSED = 2.0
"""Length of steps along z, relative to other steps, where stability is not tested: pads are five times as compliant
under tangential loads."""

Start = Callable[[], tuple[np.ndarray, np.ndarray]]
Touch = Callable[[LoadSegment, Followed], tuple[float, Contact] | None]


def nothing(segment: LoadSegment, pad: Followed) -> None:
    """Return None: the search for a contact on a load path without obstacles."""


class PathSegments:
    """The straight segments of a load path and the branches after buckling, kept in memory and on disk."""

    def __init__(self, path: PathProblem) -> None:
        self._path = path
        self.known: dict[tuple[float, ...], LoadSegment] = {}
        self.branches: dict[LoadSegment, BuckledBranch] = {}

    def to(self, value: np.ndarray) -> list[tuple[LoadSegment, float]]:
        """The straight segments of the load path to ``value``, and for each the distance at which the path leaves it.
        """
        normal = normal_part(value)
        others = value - normal
        distance, segments = self._size(others), []
        if normal.any():
            segments.append((self.towards(np.zeros_like(value), np.sign(normal)), float(np.abs(normal).max())))
        if distance:
            direction = np.round(others / distance, 12)
            segments.append((self.towards(normal, direction), distance))
        return segments

    def _size(self, change: np.ndarray) -> float:
        """Magnitude, in N, of a change of a tangential load. A moment is divided by a length of the load, which makes
        it a force.
        """
        tangential = float(np.hypot(*change[:2])) if len(change) > 1 else 0.0
        if len(change) <= 3:
            return tangential
        return math.hypot(tangential, *(change[3:] / self._path.load.length(self._path.mesh)))

    def towards(self, origin: np.ndarray, direction: np.ndarray) -> LoadSegment:
        """The segment that begins at a value of the load and follows a direction.

        Parameters
        ----------
        origin : (c,) ndarray
            Value of the load at its start.
        direction : (c,) ndarray
            Direction of the change of the load's value.

        Returns
        -------
        LoadSegment
            Segment from memory, from disk, or new.
        """
        index = (*origin, *direction)
        if index not in self.known:
            step = self._path.step
            if not (self._path.judged or direction[:-1].any() or self.pad_for(origin, direction).solves_between):
                step *= LONGER_PRESSED
            segment = LoadSegment(origin, direction, step, self._path.judged, self._path.step_tolerance)
            self.known[index] = segment
            self._take_stored(segment)
        return self.known[index]

    def pad_for(self, origin: np.ndarray, direction: np.ndarray) -> LoadedPad:
        """The symmetric part of the pad on which a segment is solved; it is bounded by planes of symmetry (mirrors).

        Parameters
        ----------
        origin : (c,) ndarray
            Value of the load at its start.
        direction : (c,) ndarray
            Direction of the change of the load's value.

        Returns
        -------
        LoadedPad
            Pad between the mirrors that leave the loads of the segment unchanged.
        """
        path, kept = np.stack([origin, direction]), self.mirrors_at(origin + direction)
        mirrors = tuple(m for m in kept if path.shape[1] == 1 or np.array_equal(mirrored_value(m, path), path))
        segment, rest = self.known.get((*origin, *direction)), np.zeros_like(origin)
        # The pad is at least as compliant as under the normal load alone.
        if origin.any() and not (segment and segment.nodes):
            segment = self.known.get((*rest, *np.sign(origin)))
        return self.pad_between(mirrors, segment.ticks if segment else TICKS)

    def pad_between(self, mirrors: tuple[Mirror, ...], ticks: int) -> LoadedPad:
        """The part of the pad that is bounded by planes of symmetry (mirrors), with the equations for a segment that
        has this number of ticks (shortest intervals) in a step.
        """
        return loaded_pad(self._path.mesh, self._path.material, self._path.load, mirrors, self._path.bodies, ticks)

    def extend(self, segment: LoadSegment, pad: LoadedPad, s: float, start: Start, touch: Touch) -> None:
        """Solve a segment up to a distance, or until the pad touches something.

        States that another process has solved meanwhile are read from disk.

        Parameters
        ----------
        segment : LoadSegment
            The segment.
        pad : LoadedPad
            Symmetric part of the pad on which the segment is solved.
        s : float
            Load as distance along the segment, in N, mm or MPa.
        start : Start
            Computes displacement and pressure at its origin.
        touch : Touch
            Finds contacts with obstacles.
        """
        with cache.alone(self.name_of(segment)):
            self._take_stored(segment)
            before = len(segment.nodes), segment.limit
            try:
                segment.begin(pad, lambda: pad.gather(*start()))
                pad = self.pad_between(pad.mirrors, segment.ticks)
                contact = self._contact(pad)
                segment.extend(pad, s, lambda: pad.gather(*start()), contact, lambda: touch(segment, pad) is not None)
                onset = find_onset(pad, segment) if self.may_buckle and segment in self.known.values() else None
                if onset:
                    segment.end_buckling(pad, contact, *onset)
            finally:
                if (len(segment.nodes), segment.limit) != before:
                    cache.store(self.name_of(segment), segment.arrays())

    def _contact(self, pad: LoadedPad) -> ContactTest:
        return self._path.contact if self._path.load.self_contact else pad.contact

    def _take_stored(self, segment: LoadSegment) -> None:
        arrays = cache.load(self.name_of(segment))
        if arrays is not None and len(arrays["s"]) >= len(segment.nodes):
            segment.restore(arrays)

    def name_of(self, segment: LoadSegment) -> str:
        """The file name under which a segment is cached on disk."""
        numerics = [segment.step, segment.judged, RESIDUAL_TOLERANCE, segment.tolerance, available_solvers()[0]]
        ends = segment.origin.tolist(), segment.direction.tolist()
        return cache.key("segment", *self._path.key_parts, numerics, *ends)

    def extended_branch(self, segment: LoadSegment, s: float, touch: Touch) -> BuckledBranch:
        """The states of the buckled pad beyond the end of a segment, solved up to a distance or until the pad touches
        something.

        Parameters
        ----------
        segment : LoadSegment
            The segment.
        s : float
            Load as distance along the segment, in N, mm or MPa.
        touch : Touch
            Finds contacts with obstacles.

        Returns
        -------
        BuckledBranch
            The branch.
        """
        branch, name = self.branch(segment), cache.key("buckled", self.name_of(segment))
        with cache.alone(name):
            arrays = cache.load(name)
            if arrays is not None and len(arrays["s"]) > len(branch.curve.nodes):
                branch.curve.restore(arrays)
            before = len(branch.curve.nodes), branch.curve.limit
            try:
                branch.extend(s, self._contact(branch.pad), lambda: touch(branch.curve, branch.buckled) is not None)
            finally:
                if (len(branch.curve.nodes), branch.curve.limit) != before:
                    cache.store(name, branch.curve.arrays())
        if branch.onwards and s > branch.solved_to:
            last = branch.curve.nodes[-1].unknowns[:-1]
            self.extend(branch.onwards, branch.pad, s - branch.solved_to, lambda: branch.pad.split(last), touch)
        return branch

    def part_to(self, segment: LoadSegment, s: float) -> tuple[LoadSegment | BuckledBranch, float, LoadedPad]:
        """Find the part of a load path that contains a state: the segment itself, or the branch after buckling.

        Parameters
        ----------
        segment : LoadSegment
            The segment.
        s : float
            Load as distance along the segment, in N, mm or MPa.

        Returns
        -------
        curve : LoadSegment or BuckledBranch
            The segment, or its continuation.
        distance : float
            Distance along the curve.
        pad : LoadedPad
            Part of the pad that the curve is solved on.
        """
        if not segment.mode.size or s <= segment.limit:
            return segment, s, self.pad_for(segment.origin, segment.direction)
        branch = self.branch(segment)
        if branch.onwards and s > branch.solved_to:
            return branch.onwards, s - branch.solved_to, branch.pad
        return branch, s, branch.pad

    def branch(self, segment: LoadSegment) -> BuckledBranch:
        """The states of the buckled pad beyond the end of a segment."""
        if segment not in self.branches:
            pad = self.pad_for(segment.origin, segment.direction)
            kept = tuple(mirror for mirror in pad.mirrors if is_kept(segment.mode, mirror, self._path.images[mirror]))
            state = pad.split(segment.nodes[-1].unknowns)
            self.branches[segment] = BuckledBranch(self.pad_between(kept, segment.ticks), segment, state)
        return self.branches[segment]

    def buckled_at(self, value: np.ndarray, mirrors: Sequence[Mirror] = ()) -> np.ndarray | None:
        """The load at which the pad buckles on the path to a load, or None.

        Parameters
        ----------
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        mirrors : Sequence[Mirror]
            Mirrors that map the load to the canonical one.

        Returns
        -------
        (c,) ndarray or None
            None if the pad does not buckle.
        """
        if not self.may_buckle:
            return None
        for segment, s in self.to(value):
            if segment.mode.size and s > segment.limit:
                critical = segment.value(segment.limit)
                for mirror in reversed(mirrors):
                    critical = mirrored_value(mirror, critical)
                return critical
        return None

    @property
    def may_buckle(self) -> bool:
        """Whether states after buckling are computed."""
        load = self._path.load
        return self._path.judged and load.indenter is None and not load.tilts

    def follow_normal(self, value: np.ndarray) -> None:
        """Solve the segment on which only the normal load grows, to learn whether the pad buckles on it: a buckled pad
        has fewer planes of symmetry.
        """
        normal = normal_part(value)
        if self.may_buckle and normal.any() and (value - normal).any():
            ((segment, s),) = self.to(normal)
            if not segment.reaches(s):
                rest = np.zeros_like(self._path.mesh.points), np.zeros(self._path.mesh.corner_count)
                self.extend(segment, self.pad_for(segment.origin, segment.direction), s, lambda: rest, nothing)

    def mirrors_at(self, value: np.ndarray) -> list[Mirror]:
        """Planes of symmetry (mirrors) of the deformed pad under the normal part of a load alone."""
        normal = normal_part(value)
        if not self.may_buckle or not (value - normal).any():
            return list(self._path.images)
        if self.buckled_at(normal) is None:
            return list(self._path.images)
        ((segment, _),) = self.to(normal)
        return list(self.branch(segment).pad.mirrors)
