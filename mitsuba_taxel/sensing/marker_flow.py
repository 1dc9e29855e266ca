"""Flow of the markers on a coat: how far each is displaced by the load, in space and in the image."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.pads.block import Block
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

if TYPE_CHECKING:
    import mitsuba as mi

    from mitsuba_taxel.kernels.protocols import PadShape

NEAR = 1.0
"""Largest distance in pixels of a marker in the image from the centre of the nearest pixel that shows the coat."""
COLUMNS = {
    "x_mm": ("unloaded", 0),
    "y_mm": ("unloaded", 1),
    "z_mm": ("unloaded", 2),
    "ux_mm": ("displacement", 0),
    "uy_mm": ("displacement", 1),
    "uz_mm": ("displacement", 2),
    "column": ("pixel", 0),
    "row": ("pixel", 1),
    "column_flow": ("pixel_flow", 0),
    "row_flow": ("pixel_flow", 1),
}
"""Columns of tables of markers: attribute and component of a `MarkerFlow`."""


@dataclass(frozen=True, eq=False)
class MarkerFlow:
    """Places and displacements of the M markers on a coat.

    Attributes
    ----------
    unloaded : (M, 3) ndarray
        Places of the centres on the unloaded coat, in mm in the scene.
    displacement : (M, 3) ndarray
        Their displacement by the load, in mm along x, y and z of the scene.
    pixel : (M, 2) ndarray
        Where the image of the unloaded pad shows them: columns from its left edge and rows from its top edge, in
        pixels; NaN where it does not.
    pixel_flow : (M, 2) ndarray
        How far they move in the image, in pixels along columns and rows; NaN where one of both images does not show
        them.
    """

    unloaded: np.ndarray
    displacement: np.ndarray
    pixel: np.ndarray
    pixel_flow: np.ndarray

    def columns(self) -> dict[str, np.ndarray]:
        """Columns (M,) of a table with a row for each marker, by their headings."""
        numbers = {"marker": np.arange(1, len(self.unloaded) + 1)}
        return numbers | {name: getattr(self, part)[:, k] for name, (part, k) in COLUMNS.items()}

    def as_lists(self) -> dict[str, list[Any]]:
        """Convert the arrays to lists for JSON, with None instead of NaN."""
        arrays: dict[str, np.ndarray] = {field.name: getattr(self, field.name) for field in fields(self)}
        lists = {}
        for name, values in arrays.items():
            known = values.astype(object)
            known[np.isnan(values)] = None
            lists[name] = known.tolist()
        return lists

    @classmethod
    def of_lists(cls, lists: Mapping[str, list[Any]]) -> MarkerFlow:
        """Create the markers from the lists that `as_lists` returns.

        Parameters
        ----------
        lists : Mapping[str, list]
            The arrays as lists.

        Returns
        -------
        MarkerFlow
            The markers.
        """
        return cls(**{name: np.array(rows, dtype=float) for name, rows in lists.items()})


def has_markers(scene: mi.Scene) -> bool:
    """Whether a pad of a scene has markers.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    bool
        True if there are markers.
    """
    return any(pad.specification.build_markers() is not None for pad in deformed_pads(scene))


def marker_flow(scene: mi.Scene, loaded: np.ndarray, unloaded: np.ndarray) -> MarkerFlow:
    """The flow of the markers on the pads of a scene.

    Displacements follow from the finite elements. The place of a marker in the image is interpolated between pixels,
    each of which shows a known point of the coat; it therefore includes refraction.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene whose pads have markers.
    loaded, unloaded : (H, W, 3) ndarray
        Place on the unloaded coat, in mm in the scene, of the point that each pixel shows, with and without the loads;
        NaN in pixels that do not show the coat.

    Returns
    -------
    MarkerFlow
        All markers, pad by pad.
    """
    painted = [pad for pad in deformed_pads(scene) if pad.specification.build_markers() is not None]
    places, displacements = zip(*map(_at_markers, painted), strict=True)
    rest = np.concatenate(places)
    before, after = (_in_image(shown, rest) for shown in (unloaded, loaded))
    return MarkerFlow(rest, np.concatenate(displacements), before, after - before)


def write_markers(flow: MarkerFlow, file: Path) -> None:
    """Write markers as a table.

    Parameters
    ----------
    flow : MarkerFlow
        The markers.
    file : Path
        CSV file, which is replaced if it exists.
    """
    columns = flow.columns()
    rows = zip(*columns.values(), strict=True)
    lines = [",".join("" if math.isnan(value) else f"{value:.9g}" for value in row) for row in rows]
    write_text(file, "\n".join([",".join(columns), *lines]) + "\n")


def _at_markers(pad: PadShape) -> tuple[np.ndarray, np.ndarray]:
    """Places (M, 3) of a pad's markers on its unloaded coat, and their displacements (M, 3), in mm of the scene."""
    turn, shift = pad.to_world[:3, :3], pad.to_world[:3, 3]
    rest = pad.undeformed.vertices
    moved = np.einsum("vi,ji->vj", pad.surface.vertices, turn) + shift - rest
    corners = pad.surface.triangles[pad.surface.region == REGIONS["top"]]
    own = np.einsum("vi,ij->vj", rest - shift, np.linalg.inv(turn).T)[corners][:, :, :2]  # x and y in the pad
    markers = pad.specification.build_markers()
    assert markers is not None and isinstance(pad.pad, Block)  # others have no markers
    places, displacements = [], []
    inverse = np.linalg.inv(np.stack([own[:, 1] - own[:, 0], own[:, 2] - own[:, 0]], axis=-1))
    for centre in markers.centres(pad.pad):
        weights = np.einsum("tij,tj->ti", inverse, centre - own[:, 0])
        weights = np.concatenate([1 - weights.sum(axis=1, keepdims=True), weights], axis=1)
        inside = int(np.argmax(weights.min(axis=1)))
        places.append(weights[inside] @ rest[corners[inside]])
        displacements.append(weights[inside] @ moved[corners[inside]])
    return np.array(places), np.array(displacements)


def _in_image(shown: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Columns and rows (M, 2) of points (M, 3) in an image whose pixels show the points ``shown`` (H, W, 3)."""
    height, width, _ = shown.shape
    if min(height, width) < 2:
        return np.full((len(points), 2), math.nan)
    down, right = np.gradient(shown, axis=(0, 1))
    found = []
    for point in points:
        distance = np.linalg.norm(shown - point, axis=-1)
        if np.isnan(distance).all():
            found.append((math.nan, math.nan))
            continue
        row, column = np.unravel_index(np.nanargmin(distance), distance.shape)
        along = np.stack([right[row, column], down[row, column]], axis=1)
        step = np.full(2, math.nan)
        if np.isfinite(along).all():
            step = np.linalg.lstsq(along, point - shown[row, column], rcond=None)[0]
        step = step if np.abs(step).max() <= NEAR else np.full(2, math.nan)
        found.append((column + 0.5 + step[0], row + 0.5 + step[1]))
    return np.array(found).reshape(-1, 2)
