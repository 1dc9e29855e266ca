"""Misplaced parts: LEDs inside a body or facing away, packages in the silicone, gaps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mitsuba_taxel.check.faces import CORNERS, Boxes, Faces, apply, boxes_of, faces_of, to_world
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.parts import PAD, Parts, ScenePart
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.room import ROUNDING, holds, nearest_cell, room_needed

GAP = 1e-3
"""Negligible distance in mm between pad and board."""
_ON_SURFACE = 1e-4
"""Negligible distance from the surface of a box, relative to its half side."""


def check_geometry(parts: Parts) -> Iterator[Finding]:
    """Findings on a scene's geometry, with its pads undeformed."""
    faces, nowhere = faces_of(parts)
    yield from nowhere
    boxes = boxes_of(parts)
    for face in faces:
        for box in boxes:
            if box.part is not face.carrier:
                yield from _in_a_box(face, box)
    if parts.sound:
        yield from _nothing_in_front(faces, parts)
    pads = [part for part in parts.shapes() if part.plugin == PAD]
    for pad in pads:
        yield from _board(pad, faces, parts)
    bodies = [box for box in boxes if box.part.plugin == "photo_reflector"]
    if parts.sound and pads:
        for body in bodies:
            yield from _in_cells(body, pads)


def _in_a_box(face: Faces, box: Boxes) -> Iterator[Finding]:
    """An LED or phototransistor inside a box, or on one of its faces and facing into it."""
    what, where = face.part.plugin, f"the {box.part.plugin} of line {box.part.element.line}"
    places = box.relative(face.centres)
    turn = (box.relative(face.centres[:1] + 1e-3 * face.side * face.normal) - places[:1])[0]
    on_surface = np.abs(np.abs(places).max(axis=1) - 1) < _ON_SURFACE
    axis = np.abs(places).argmax(axis=1)
    outwards = turn[axis] * np.sign(places[np.arange(len(places)), axis])
    if np.any(np.abs(places).max(axis=1) <= 1 - _ON_SURFACE):
        yield face.part.finding("warning", f"{what} lies inside {where}, where light hardly comes: move one of them.")
    elif np.any(on_surface & (outwards < 0)):
        yield face.part.finding("warning", f"{what} lies on {where} and looks into it: turn it round.")


def _nothing_in_front(faces: list[Faces], parts: Parts) -> Iterator[Finding]:
    """LEDs and phototransistors with no other shape in front."""
    extents = [(part, _corners(part)) for part in parts.shapes()]
    if any(corners is None for _, corners in extents):
        return
    for face in faces:
        others = [corners for part, corners in extents if part is not face.carrier]
        ahead = [np.max((corners - face.centres[0]) @ face.normal) for corners in others]
        if all(distance <= ROUNDING * face.side for distance in ahead):
            what = f"nothing lies in front of the {face.part.plugin}"
            yield face.part.finding("warning", f"{what}: turn it round, or add what is to reflect light.")


def _corners(part: ScenePart) -> np.ndarray | None:
    """(8, 3) corners of a bounding box of a shape in the world; None if unknown."""
    if part.plugin == PAD:
        if not isinstance(part.made.pad, Pad):
            return None
        size = np.array(part.made.pad.extent)
        return apply(part.made.to_world, 0.5 * size * CORNERS + [0, 0, 0.5 * size[2]])
    box = part.made.bbox()
    low, high = np.array(box.min, dtype=float).ravel(), np.array(box.max, dtype=float).ravel()
    if not np.all(low <= high):
        return None
    return 0.5 * (low + high) + 0.5 * (high - low) * CORNERS


def _board(pad: ScenePart, faces: list[Faces], parts: Parts) -> Iterator[Finding]:
    """A board that is not in the plane of the pad's bottom, or covers LEDs or phototransistors."""
    from_world = np.linalg.inv(pad.made.to_world)
    highest = 0.5 * pad.made.pad.top_of_cell if isinstance(pad.made.pad, Pad) else 0.2
    candidates = [
        part
        for part in parts.shapes()
        if part.plugin not in (PAD, "photo_reflector") and not part.nested("emitter") and not part.nested("sensor")
    ]
    boards = []
    for part in candidates:
        if part.plugin in ("rectangle", "cube"):
            found = _horizontal(from_world @ to_world(part), part.plugin == "cube")
            if found is not None and found[0] < highest and np.all(found[1] < 0) and np.all(found[2] > 0):
                boards.append((found, part))
    if not boards:
        if not candidates and parts.sound:
            lost = "light that leaves a cell downwards is lost, as on a board that absorbs"
            yield pad.finding("note", f"there is no board under the {PAD}: {lost}.")
        return
    (height, low, high), board = max(boards, key=lambda entry: entry[0][0])
    if abs(height) > GAP:
        where = "below the bottom of the pad, and light passes between the two"
        if height > 0:
            where = "above the bottom of the pad, in its silicone"
        yield board.finding(
            "warning", f"the board ({board.plugin}) lies {abs(height):.3g} mm {where}: move one of them."
        )
    for face in faces:
        local, normal = apply(from_world, face.centres), from_world[:3, :3] @ face.normal
        over = np.all((local[:, :2] > low) & (local[:, :2] < high), axis=1)
        what, name = face.part.plugin, f"the board ({board.plugin} of line {board.element.line})"
        if np.any(over & (local[:, 2] < height - 1e-4 * face.side)):
            yield face.part.finding("warning", f"{what} lies under {name}: raise it, or lower the board.")
        elif np.any(over & (local[:, 2] < highest)) and normal[2] < 0:
            yield face.part.finding("warning", f"{what} looks at {name}, not at the roof of its cell: turn it round.")


def _horizontal(matrix: np.ndarray, solid: bool) -> tuple[float, np.ndarray, np.ndarray] | None:
    """Height of a rectangle's plane or a cube's top, and the corners (2,) of its area; None if it is tilted."""
    axes, centre = matrix[:3, :3], matrix[:3, 3]
    normal = np.cross(axes[:, 0], axes[:, 1])
    if not np.hypot(*normal[:2]) <= 1e-3 * np.abs(normal[2]):
        return None
    reach = np.abs(axes).sum(axis=1) if solid else np.abs(axes[:, :2]).sum(axis=1)
    return centre[2] + (reach[2] if solid else 0.0), centre[:2] - reach[:2], centre[:2] + reach[:2]


def _in_cells(body: Boxes, pads: list[ScenePart]) -> Iterator[Finding]:
    """Packages in the silicone, beside the pad, or in cells that are not read."""
    stand = np.zeros(body.rows * body.columns, dtype=bool)
    for pad in pads:
        shape = pad.made.pad
        corners = apply(np.linalg.inv(pad.made.to_world), body.corners())
        if pad.made.cell_boxes is not None:
            stand |= _reach_into(corners, pad.made.cell_boxes)
            continue
        half = 0.5 * np.array(shape.extent[:2])
        low, high = corners.min(axis=1), corners.max(axis=1)
        near = np.all((low[:, :2] < half) & (high[:, :2] > -half), axis=1)
        near &= (low[:, 2] < shape.height) & (high[:, 2] > 0)
        cells = np.array(shape.cell_centres)
        number = nearest_cell(shape, 0.5 * (low + high)[:, :2])
        free = holds(shape, corners - np.insert(cells[number], 2, 0, axis=1)[:, None])
        stand |= near
        if np.any(near & ~free):
            index = int(np.argmax(near & ~free))
            yield _stands_in_silicone(body, pad, index, corners[index])
        elif np.any(near):
            yield from _other_pitch(body, pad)
            yield from _cells_not_read(body, pad, number[near & free] + 1)
    if not np.all(stand):
        count = f"{np.count_nonzero(~stand)} of {len(stand)} packages of photo_reflector stand"
        remedies = ["check rows, columns, pitch and to_world of both"]
        for pad in pads:
            if pad.made.cell_boxes is not None:
                remedies.append(pad.made.pad.placement.advice(pad.made.extent, pad.made.cell_boxes))
        yield body.part.finding("warning", f"{count} beside the {PAD}, in no cell: {'; '.join(remedies)}.")


def _reach_into(corners: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """(N,) whether bodies, given by their corners (N, 8, 3), overlap any of some boxes (K, 2, 3)."""
    low, high = corners.min(axis=1)[:, None], corners.max(axis=1)[:, None]
    return np.any(np.all((low < boxes[:, 1]) & (high > boxes[:, 0]), axis=2), axis=1)


def _stands_in_silicone(body: Boxes, pad: ScenePart, index: int, corners: np.ndarray) -> Finding:
    shape, reflector = pad.made.pad, body.part.made
    size = " x ".join(f"{side:g}" for side in reflector.body)
    cells = f"whose cells are {shape.cell_size:g} mm wide and {shape.top_of_cell:g} mm high"
    remedy = f"{room_needed(shape, corners)}; or move it"
    grids = [(part.rows, part.columns, part.pitch) for part in (reflector, shape)]
    if grids[0] != grids[1]:
        own, pads = (f"{rows} x {columns} at {pitch:g} mm" for rows, columns, pitch in grids)
        remedy = f"its array is {own}, that of the cells {pads}"
    return body.part.finding(
        "error",
        f"package {index + 1} of photo_reflector, {size} mm, stands in the silicone of the {PAD}, {cells}: {remedy}.",
    )


def _other_pitch(body: Boxes, pad: ScenePart) -> Iterator[Finding]:
    shape, reflector = pad.made.pad, body.part.made
    both = (reflector.rows > 1 and shape.rows > 1) or (reflector.columns > 1 and shape.columns > 1)
    scale = np.cbrt(np.linalg.det(body.to_world[:3, :3]) / np.linalg.det(pad.made.to_world[:3, :3]))
    pitch = scale * reflector.pitch
    if both and abs(pitch - shape.pitch) > 1e-4 * shape.pitch:
        other = f"pitch = {pitch:g} of photo_reflector is not that of the {PAD}, {shape.pitch:g}"
        yield body.part.finding("warning", f"{other}: packages stand off the middle of their cells.", "pitch")


def _cells_not_read(body: Boxes, pad: ScenePart, numbers: np.ndarray) -> Iterator[Finding]:
    """Packages in cells whose surface is coarsely triangulated."""
    left_out = sorted(set(numbers.tolist()) - set(pad.made.read_cells or numbers.tolist()))
    if left_out:
        coarse = f"read_cells leaves out cell {', '.join(map(str, left_out))}, where a photo_reflector stands"
        yield pad.finding("warning", f"{coarse}: add it, or its surface is cut too coarsely.", "read_cells")
