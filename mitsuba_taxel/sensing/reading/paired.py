"""Readings of one scene under several loads, with little noise in their differences: light paths follow material points
of the pad from one load to another.

A reading is the sum of the reading of a base state, with the same random numbers for all loads, and the difference from
the base state, from `trace_difference`. If the LED has a narrow beam, moved paths leave the beam, and plain readings
with shared random numbers have less noise in their differences; `quieter` chooses between the two methods.
"""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.kernels.paths.paired_paths import PairedState, trace_difference
from mitsuba_taxel.kernels.walls import set_wavelength
from mitsuba_taxel.sensing.reading.mechanics_error import move, restored
from mitsuba_taxel.sensing.reading.runs import REPLICATES, Prepared, derived_seed, prepare, traced
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.specification.taxel_tracer import TaxelTracer

PAIRED = 25
"""Index of the seed of differences, for `derived_seed`."""
PILOT_POINTS = 512
"""Number of points per taxel and replicate of the pilot run that compares the noise of both kinds of differences."""
NOT_PAIRED = (
    mi.BSDFFlags.Delta
    | mi.BSDFFlags.Delta1D
    | mi.BSDFFlags.Glossy
    | mi.BSDFFlags.Null
    | mi.BSDFFlags.Transmission
    | mi.BSDFFlags.Anisotropic
)
"""Properties of BSDFs for which paths through material points are not used: such paths do not exist between given
points, depend on the orientation of triangles, or have more noise. At a rough mirror of 5 degrees, moved paths leave
the lobe, and have two to three times the noise of shared random numbers."""


def can_be_paired(ready: Prepared) -> bool:
    """Whether differences between loads of a scene can be computed by light paths through the same material points.

    This needs one pad, LEDs and phototransistors without windows in one plane, diffuse walls, and a `taxel_tracer` of
    all paths.

    Parameters
    ----------
    ready : Prepared
        The scene, under any load.

    Returns
    -------
    bool
        False, for example, for a scene with mirrors.
    """
    tracer = getattr(ready.integrator, "specification", None)
    if not (isinstance(tracer, TaxelTracer) and tracer.max_depth < 0 and tracer.strategy == "all"):
        return False
    try:
        pairs = taxels_of(ready.scene)
    except InputError:  # LEDs and phototransistors cannot be paired
        return False
    if len(deformed_pads(ready.scene)) != 1 or any(pair.is_below_windows or not pair.coplanar for pair in pairs):
        return False
    return not any(shape.bsdf() is not None and shape.bsdf().flags() & NOT_PAIRED for shape in ready.scene.shapes())


def paired(base: Scene, scene: Scene) -> Prepared:
    """Prepare a scene for readings with little noise in their differences from a base scene. They are computed as those
    of the base scene plus a difference, if this is possible and reduces the noise.

    Parameters
    ----------
    base : Scene
        The same scene under another load; see :func:`paired_with`.
    scene : Scene
        The scene to read.

    Returns
    -------
    Prepared
        The scene; its readings are not paired if the base scene does not exist, :func:`can_be_paired` is false, or
        paired readings have more noise.
    """
    try:
        loaded_base = prepare(base)
    except (InputError, ComputationError):
        return prepare(scene)
    return quieter(paired_with(base, loaded_base, scene)) if can_be_paired(loaded_base) else prepare(scene)


def paired_with(base: Scene, loaded_base: Prepared, scene: Scene) -> Prepared:
    """Prepare a scene so that its readings are computed as those of a base scene plus a difference.

    Parameters
    ----------
    base : Scene
        The same scene under another load, preferably the largest load of a study, because the elements of this state
        are used for the unloaded pad too.
    loaded_base : Prepared
        The prepared base scene, for which :func:`can_be_paired` is true.
    scene : Scene
        The scene to read.

    Returns
    -------
    Prepared
        The scene; its readings are not paired if the triangles of both states differ.
    """
    ready = prepare(scene)
    if isinstance(scene.source, Path) and (scene.source, scene.parameters) == (base.source, base.parameters):
        return ready._replace(paired=PairedReading(loaded_base, ready, None))
    (pad,), (base_pad,) = deformed_pads(ready.scene), deformed_pads(loaded_base.scene)
    moved = ready.scene
    # An unloaded pad may have larger elements: the elements of the base state are used.
    if not pad.is_loaded and pad.state.mesh is not base_pad.state.mesh:
        moved = prepare(base).scene
        (pad,) = deformed_pads(moved)
        pad.take(pad.at_onset())
        moved.parameters_changed([])
    region, base_region = pad.changing_region(), base_pad.changing_region()
    touched = region is not None and base_region is not None and not np.array_equal(region, base_region)
    if touched or not np.array_equal(pad.surface.triangles, base_pad.surface.triangles):
        return ready
    return ready._replace(paired=PairedReading(loaded_base, ready, moved))


def quieter(ready: Prepared) -> Prepared:
    """Choose between paired and plain readings of a scene: the method with less noise in the difference from the base
    state.

    Parameters
    ----------
    ready : Prepared
        The scene of :func:`paired_with`.

    Returns
    -------
    Prepared
        The scene with the chosen method. The choice does not depend on the seed of the readings.
    """
    return ready if ready.paired is None or ready.paired.has_less_noise() else ready._replace(paired=None)


class PairedReading:
    """Readings of a scene, computed as those of a base state plus a difference, so that both share their noise.

    Parameters
    ----------
    base : Prepared
        The base state.
    ready : Prepared
        The scene.
    moved : mi.Scene or None
        The scene with the deformed pad on the triangles of the base state; None if the scene is the base state.
    """

    def __init__(self, base: Prepared, ready: Prepared, moved: mi.Scene | None) -> None:
        self._base, self._ready, self._moved = base, ready, moved

    def powers(self, points: int, seed: int, first: int) -> tuple[np.ndarray, int]:
        """Readings (R, T) in W of T taxels in R replicates, and the number of points (paths) used, counted from the
        point ``first`` of the random sequences.
        """
        powers, _, points = traced(self._base, points, seed, first, False)
        if self._moved is not None:
            powers = powers + _difference(self._base.scene, self._moved, points, derived_seed(seed, PAIRED), first)
        return powers, points

    def has_less_noise(self) -> bool:
        """Whether the paired difference from the base state has less noise than the difference of two plain readings
        with shared random numbers.

        A pilot run compares the variances, summed over the taxels.
        """
        if self._moved is None:
            return True
        seed = derived_seed(0, PAIRED)
        by_points = _difference(self._base.scene, self._moved, PILOT_POINTS, seed, 0)
        base, other = (traced(ready, PILOT_POINTS, seed, 0, False)[0] for ready in (self._base, self._ready))
        return bool(by_points.var(axis=0).sum() <= (other - base).var(axis=0).sum())

    def deviations(self, seed: int, points: int) -> tuple[np.ndarray, np.ndarray | None]:
        """Readings of the base state, and changes of the scene's readings on coarser finite elements, in the form that
        `mechanics_deviations` returns."""
        (pad,), pads = deformed_pads(self._ready.scene), deformed_pads(self._base.scene)
        before = traced(self._base, points, seed, 0, False)[0]
        with stages.stage("mechanics"):
            fraction = pad.state.probed_share
            surfaces = pad.deviating_places(fraction)
        if surfaces is None:
            return before, None
        changes = []
        with restored(self._base.scene, pads):
            for surface in surfaces:
                move(self._base.scene, pads, [surface])
                changes.append(_difference(self._ready.scene, self._base.scene, points, seed, 0) / fraction)
        return before, np.array(changes)


def _difference(first: mi.Scene, second: mi.Scene, points: int, seed: int, start: int) -> np.ndarray:
    """Readings (R, T) of the second scene minus those of the first, in W."""
    before, after = (PairedState(scene, deformed_pads(scene)[0]) for scene in (first, second))
    columns = []
    for pair in taxels_of(first):
        for scene in (first, second):
            set_wavelength(scene, [pair.led])
        columns.append(trace_difference(before, after, pair, points, seed, REPLICATES, first_point=start))
    return np.concatenate(columns, axis=1)
