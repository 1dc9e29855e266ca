"""Computations that are omitted because the readings of a scene do not need them, with the reasons.

The lines are derived from the loaded scene, not from its file.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import mitsuba as mi
import numpy as np

from mitsuba_taxel.kernels.paths.taxel_integrators import guides_emission, traces_taxels
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.kernels.surfaces.regions import ALL_REGIONS
from mitsuba_taxel.kernels.taxel_pair import TaxelPair
from mitsuba_taxel.kernels.walls import absorbs, has_mirrors, wall_at
from mitsuba_taxel.sensing.reading.runs import Prepared
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.sensing.scene.taxels import taxels_of

if TYPE_CHECKING:
    from mitsuba_taxel.geometry.mirror import Mirror
    from mitsuba_taxel.mechanics import State

_PARTS = {1: "half", 2: "a quarter", 4: "an eighth"}
"""Solved part of a pad, in words, by the number of mirror symmetries."""
_PLANES = {"x": "x = 0", "y": "y = 0", "xy": "y = x", "-xy": "y = -x"}
"""The plane of each mirror, by its name."""
_FLAT = 4e-7
"""Largest distance of points in a common plane from this plane, relative to the largest coordinate: rounding of single
precision."""


def left_out(
    ready: Prepared, *, irradiance: bool = False, crosstalk: bool = False, began: float | None = None
) -> list[str]:
    """List the computations that are omitted because the readings of a scene do not need them, with the reasons.

    Parameters
    ----------
    ready : Prepared
        The scene, from `prepare`.
    irradiance, crosstalk : bool
        Whether the irradiance map, or the power from each LED on each phototransistor, is requested.
    began : float, optional
        ``time.time()`` before the scene was first loaded; if given, the lines state whether all meshes and solutions
        came from the disk cache.

    Returns
    -------
    list[str]
        A line for each omission; empty if nothing is omitted.

    Raises
    ------
    InputError
        if LEDs and phototransistors cannot be paired.
    """
    scene = ready.scene
    pads = deformed_pads(scene)
    lines = [line for pad in pads for line in _of_pad(pad)]
    if not pads:
        lines.append("no pad: no mechanics imported, meshed or solved")
    elif began is not None and _all_kept_before(began):
        lines.append("meshes and solutions found in the disk cache: nothing meshed or solved again")
    pairs = taxels_of(scene)
    lines += [*_of_cells(pads, pairs), *_of_paths(ready, pairs)]
    taxels = sum(pair.count for pair in pairs)
    if traces_taxels(ready.integrator) and taxels > 1 and not crosstalk:
        lines.append(f"crosstalk not requested: {taxels} pairs of LED and phototransistor traced, not {taxels**2}")
    if not irradiance:
        lines.append("irradiance map not requested: none accumulated")
    if mi.variant().endswith("_mono") or traces_taxels(ready.integrator):  # which traces the first only
        lines.append("one narrow band of wavelengths: one channel traced, not three")
    return list(dict.fromkeys(lines))


def _of_pad(pad: PadShape) -> Iterator[str]:
    """Lines of text on computations that are omitted in the mechanics of one pad."""
    if not pad.is_loaded:
        yield "pad without load: no error of the mechanics to estimate"
        if pad.mesh_tolerance is None:
            yield "pad without load: meshed, nothing solved"
    for end, mirrors in () if pad.remembers else _symmetric_segments(pad.state):
        planes = ", ".join(_PLANES[mirror.name] for mirror in mirrors)
        where = f"({', '.join(f'{component:g}' for component in end)})" if len(end) > 1 else f"{end[0]:g}"
        yield (
            f"symmetric pad and load: {_PARTS[len(mirrors)]} of the pad solved on the way to {pad.load.quantity} "
            f"{where} {pad.load.unit}, mirrored in {planes}"
        )
    if pad.finish is None:
        yield "smooth cells: no finish computed"


def _symmetric_segments(state: State) -> Iterator[tuple[np.ndarray, list[Mirror]]]:
    """For each segment of the load path to a state: its end, the load as an array of K components, and the mirror
    symmetries of pad and load on this segment."""
    from mitsuba_taxel.mechanics.elements.loads import mirrored_value, normal_part
    from mitsuba_taxel.mechanics.equilibrium.pad_parts import mirror_images

    if not state.value.any():
        return
    bodies, images = state.bodies, mirror_images(state.mesh, state.load)
    mirrors = [mirror for mirror in images if bodies is None or bodies.kept_by(mirror)]
    segments = [(state.value, mirrors)]
    if len(state.value) > 1:
        normal = normal_part(state.value)
        tangential = state.value - normal
        direction = np.round(tangential / (np.linalg.norm(tangential) or 1.0), 12)  # as in `load_path`
        keeping = [mirror for mirror in mirrors if np.array_equal(mirrored_value(mirror, direction), direction)]
        segments = [(normal, mirrors)] * bool(normal.any()) + [(state.value, keeping)] * bool(tangential.any())
    yield from ((end, kept) for end, kept in segments if kept)


def _all_kept_before(began: float) -> bool:
    """Whether all meshes and solutions were read from the disk cache: the cache is writable, and has no entry that is
    newer than the time ``began``, in s.
    """
    from mitsuba_taxel.mechanics import cache

    folder = cache.folder()
    times = [file.stat().st_mtime for file in folder.glob("*.npz")]
    return bool(times) and os.access(folder, os.W_OK) and max(times) < began


def _of_cells(pads: Sequence[PadShape], pairs: list[TaxelPair]) -> Iterator[str]:
    """Lines of text on cells of pads whose walls are divided into coarse triangles, or are not traced."""
    cells = [set(np.unique(pad.state.mesh.face_cell)) - {0} for pad in pads]
    total = sum(map(len, cells))
    coarse = sum(len(all_ - set(pad.read_cells or all_)) for pad, all_ in zip(pads, cells, strict=True))
    if coarse:
        yield f"{coarse} of {total} cells not read: their walls divided into few triangles"
    middles = [_middle(pad, cell) for pad, all_ in zip(pads, cells, strict=True) for cell in sorted(all_)]
    leds = np.concatenate([np.array(pair.led.faces.centres).T for pair in pairs])
    if middles:
        lit = np.unique(np.linalg.norm(leds[:, None] - np.array(middles), axis=2).argmin(axis=1))
        if len(lit) < total:
            yield f"no photo-reflector in {total - len(lit)} of {total} cells: no path starts there"


def _middle(pad: PadShape, cell: int) -> np.ndarray:
    """Centre (3,) of a cell of the deformed pad in world coordinates, in mm."""
    mesh = pad.state.mesh
    nodes = np.unique(mesh.faces[mesh.face_cell == cell])
    middle = (mesh.points + pad.state.displacement)[nodes].mean(axis=0)
    return pad.to_world[:3, :3] @ middle + pad.to_world[:3, 3]


def _of_paths(ready: Prepared, pairs: list[TaxelPair]) -> Iterator[str]:
    """Lines of text on the surfaces where light paths end, and on paths that are not sampled."""
    scene, integrator = ready.scene, ready.integrator
    surfaces = [surface for shape in scene.shapes() for surface in _surfaces(shape)]
    absorbing = dict.fromkeys(name for name, wall, _ in surfaces if absorbs(wall))
    if absorbing:
        yield f"absorbing walls ({', '.join(absorbing)}): paths end there"
    if not traces_taxels(integrator):
        return
    if _in_one_plane([corners for _, wall, corners in surfaces if not absorbs(wall)]):
        yield "all surfaces that reflect lie in one plane: paths end after one reflection"
    if all(pair.coplanar for pair in pairs):
        yield "LED and phototransistor in one plane: no direct light sampled between them"
    if guides_emission(integrator) and not has_mirrors(scene):
        yield "no mirror: no pilot run for emission guiding"


def _surfaces(shape: mi.Shape) -> Iterator[tuple[str, mi.BSDF | None, np.ndarray | None]]:
    """For each region of a shape: its name, its wall, and N points (N, 3) whose convex hull contains the region; None
    if they are unknown."""
    bsdf, parameters = shape.bsdf(), mi.traverse(shape)
    kind = shape.class_name().lower()
    if not (shape.is_mesh() and shape.has_attribute("face_region")):
        points = None
        if kind == "rectangle":
            to_world = np.array(parameters["to_world"].matrix, dtype=float).reshape(4, 4)
            points = to_world[:3, 3] + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ to_world[:3, :2].T
        yield shape.id() or kind, bsdf, points
        return
    vertices = np.array(parameters["vertex_positions"], dtype=float).reshape(-1, 3)
    triangles = np.array(parameters["faces"]).reshape(-1, 3)
    codes = np.rint(np.array(parameters["face_region"])).astype(int)
    for name, code in ALL_REGIONS.items():
        if (codes == code).any():
            wall = wall_at(bsdf, name)
            yield name, wall, vertices[triangles[codes == code]].reshape(-1, 3)


def _in_one_plane(reflecting: list[np.ndarray | None]) -> bool:
    """Whether all reflecting surfaces, each given by its points (N, 3), lie in one plane, so that no light goes from
    one to another."""
    if not reflecting or any(points is None for points in reflecting):
        return False
    points = np.concatenate([points for points in reflecting if points is not None])
    normal = np.linalg.svd(np.cov((points - points.mean(axis=0)).T))[0][:, 2]
    return float(np.ptp(points @ normal)) <= _FLAT * float(np.abs(points).max())
