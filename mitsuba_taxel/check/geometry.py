"""Checks of positions: LEDs inside a body or facing away, packages in the silicone, gaps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mitsuba_taxel.check.faces import CORNERS, Boxes, Faces, apply, boxes_of, faces_of, to_world
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.parts import PAD, SceneObject, SceneObjects
from mitsuba_taxel.pads import Block, Pad
from mitsuba_taxel.pads.room import ROUNDING, holds, nearest_cell, room_needed

GAP = 1e-3
"""Negligible distance in mm between pad and board."""
_ON_SURFACE = 1e-4
"""Negligible distance from the surface of a box, relative to its half side."""


def check_geometry(objects: SceneObjects) -> Iterator[Finding]:
    """Find misplaced objects of a scene, with its pads undeformed."""
    # LEDs and phototransistors against boxes, and what lies in front of them.
    faces, unplaced = faces_of(objects)
    yield from unplaced
    boxes = boxes_of(objects)
    for face in faces:
        for box in boxes:
            if box.obj is not face.carrier:
                yield from _in_a_box(face, box)
    if objects.valid:
        yield from _nothing_in_front(faces, objects)
    # Boards and packages against pads.
    pads = [obj for obj in objects.shapes() if obj.plugin == PAD]
    pads = [pad for pad in pads if not isinstance(pad.instance.pad, Block)]  # these need no board
    for pad in pads:
        yield from _board(pad, faces, objects)
    bodies = [box for box in boxes if box.obj.plugin == "photo_reflector"]
    if objects.valid and pads:
        for body in bodies:
            yield from _in_cells(body, pads)


def _in_a_box(face: Faces, box: Boxes) -> Iterator[Finding]:
    """Warn of an LED or phototransistor that lies inside a box, or that lies on a box and faces into it."""
    plugin, box_name = face.obj.plugin, f"the {box.obj.plugin} of line {box.obj.element.line}"
    positions = box.relative(face.centres)
    direction = (box.relative(face.centres[:1] + 1e-3 * face.side * face.normal) - positions[:1])[0]
    on_surface = np.abs(np.abs(positions).max(axis=1) - 1) < _ON_SURFACE
    axis = np.abs(positions).argmax(axis=1)
    outwards = direction[axis] * np.sign(positions[np.arange(len(positions)), axis])
    if np.any(np.abs(positions).max(axis=1) <= 1 - _ON_SURFACE):
        yield face.obj.finding(
            "warning", f"{plugin} lies inside {box_name}, where hardly any light arrives: move one of them."
        )
    elif np.any(on_surface & (outwards < 0)):
        yield face.obj.finding("warning", f"{plugin} lies on {box_name} and looks into it: turn it round.")


def _nothing_in_front(faces: list[Faces], objects: SceneObjects) -> Iterator[Finding]:
    """Warn of LEDs and phototransistors that face no other shape."""
    extents = [(obj, _corners(obj)) for obj in objects.shapes()]
    if any(corners is None for _, corners in extents):
        return
    for face in faces:
        other_corners = [corners for obj, corners in extents if obj is not face.carrier]
        distances = [np.max((corners - face.centres[0]) @ face.normal) for corners in other_corners]
        if all(distance <= ROUNDING * face.side for distance in distances):
            message = f"nothing lies in front of the {face.obj.plugin}"
            yield face.obj.finding("warning", f"{message}: turn it round, or add a surface that reflects light.")


def _corners(obj: SceneObject) -> np.ndarray | None:
    """Corners (8, 3) of a bounding box of a shape, mm in world coordinates; None if the extent is unknown."""
    if obj.plugin == PAD:
        if not isinstance(obj.instance.pad, Pad | Block):
            return None
        size = np.array(obj.instance.pad.extent)
        return apply(obj.instance.to_world, 0.5 * size * CORNERS + [0, 0, 0.5 * size[2]])
    box = obj.instance.bbox()
    low, high = np.array(box.min, dtype=float).ravel(), np.array(box.max, dtype=float).ravel()
    if not np.all(low <= high):
        return None
    return 0.5 * (low + high) + 0.5 * (high - low) * CORNERS


def _board(pad: SceneObject, faces: list[Faces], objects: SceneObjects) -> Iterator[Finding]:
    """Warn of a board that is not in the plane of the pad's bottom, or that covers LEDs or phototransistors."""
    # Candidates are horizontal rectangles and cubes that lie across the pad's axis, below the middle of its cells.
    from_world = np.linalg.inv(pad.instance.to_world)
    highest = 0.5 * pad.instance.pad.top_of_cell if isinstance(pad.instance.pad, Pad) else 0.2
    candidates = [
        obj
        for obj in objects.shapes()
        if obj.plugin not in (PAD, "photo_reflector") and not obj.nested("emitter") and not obj.nested("sensor")
    ]
    boards = []
    for obj in candidates:
        if obj.plugin in ("rectangle", "cube"):
            area = _horizontal(from_world @ to_world(obj), obj.plugin == "cube")
            if area is not None and area[0] < highest and np.all(area[1] < 0) and np.all(area[2] > 0):
                boards.append((area, obj))
    if not boards:
        if not candidates and objects.valid:
            consequence = "light that leaves a cell downwards is lost, as on a board that absorbs"
            yield pad.finding("note", f"there is no board under the {PAD}: {consequence}.")
        return
    # The board is the highest candidate; it must touch the bottom of the pad.
    (height, low, high), board = max(boards, key=lambda entry: entry[0][0])
    if abs(height) > GAP:
        message = "below the bottom of the pad, and light passes between the two"
        if height > 0:
            message = "above the bottom of the pad, in its silicone"
        yield board.finding(
            "warning", f"the board ({board.plugin}) lies {abs(height):.3g} mm {message}: move one of them."
        )
    # LEDs and phototransistors must lie above the board, and face away from it.
    for face in faces:
        local, normal = apply(from_world, face.centres), from_world[:3, :3] @ face.normal
        over = np.all((local[:, :2] > low) & (local[:, :2] < high), axis=1)
        plugin, name = face.obj.plugin, f"the board ({board.plugin} of line {board.element.line})"
        if np.any(over & (local[:, 2] < height - 1e-4 * face.side)):
            yield face.obj.finding("warning", f"{plugin} lies under {name}: raise it, or lower the board.")
        elif np.any(over & (local[:, 2] < highest)) and normal[2] < 0:
            yield face.obj.finding("warning", f"{plugin} looks at {name}, not at the roof of its cell: turn it round.")


def _horizontal(matrix: np.ndarray, solid: bool) -> tuple[float, np.ndarray, np.ndarray] | None:
    """Position of a horizontal rectangle, or of the top of a horizontal cube: its height, and its lowest and highest
    (2,) coordinates in x and y; None if it is tilted.
    """
    axes, centre = matrix[:3, :3], matrix[:3, 3]
    normal = np.cross(axes[:, 0], axes[:, 1])
    if not np.hypot(*normal[:2]) <= 1e-3 * np.abs(normal[2]):
        return None
    reach = np.abs(axes).sum(axis=1) if solid else np.abs(axes[:, :2]).sum(axis=1)
    return centre[2] + (reach[2] if solid else 0.0), centre[:2] - reach[:2], centre[:2] + reach[:2]


def _in_cells(body: Boxes, pads: list[SceneObject]) -> Iterator[Finding]:
    """Warn of packages in the silicone, beside the pads, or in cells that are not read."""
    in_any_pad = np.zeros(body.rows * body.columns, dtype=bool)
    for pad in pads:
        shape = pad.instance.pad
        corners = apply(np.linalg.inv(pad.instance.to_world), body.corners())
        if pad.instance.cell_boxes is not None:
            in_any_pad |= _reach_into(corners, pad.instance.cell_boxes)
            continue
        # A package belongs to the pad if their bounding boxes overlap, and must fit into the nearest cell.
        half = 0.5 * np.array(shape.extent[:2])
        low, high = corners.min(axis=1), corners.max(axis=1)
        in_pad = np.all((low[:, :2] < half) & (high[:, :2] > -half), axis=1)
        in_pad &= (low[:, 2] < shape.height) & (high[:, 2] > 0)
        cells = np.array(shape.cell_centres)
        number = nearest_cell(shape, 0.5 * (low + high)[:, :2])
        free = holds(shape, corners - np.insert(cells[number], 2, 0, axis=1)[:, None])
        in_any_pad |= in_pad
        if np.any(in_pad & ~free):
            index = int(np.argmax(in_pad & ~free))
            yield _stands_in_silicone(body, pad, index, corners[index])
        elif np.any(in_pad):
            yield from _other_pitch(body, pad)
            yield from _cells_not_read(body, pad, number[in_pad & free] + 1)
    if not np.all(in_any_pad):
        count = f"{np.count_nonzero(~in_any_pad)} of {len(in_any_pad)} packages of photo_reflector stand"
        remedies = ["check rows, columns, pitch and to_world of both"]
        for pad in pads:
            if pad.instance.cell_boxes is not None:
                remedies.append(pad.instance.pad.placement.advice(pad.instance.extent, pad.instance.cell_boxes))
        yield body.obj.finding("warning", f"{count} beside the {PAD}, in no cell: {'; '.join(remedies)}.")


def _reach_into(corners: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Mask (N,): whether each of N bodies with the corners (N, 8, 3) overlaps one of the boxes (K, 2, 3)."""
    low, high = corners.min(axis=1)[:, None], corners.max(axis=1)[:, None]
    return np.any(np.all((low < boxes[:, 1]) & (high > boxes[:, 0]), axis=2), axis=1)


def _stands_in_silicone(body: Boxes, pad: SceneObject, index: int, corners: np.ndarray) -> Finding:
    shape, reflector = pad.instance.pad, body.obj.instance
    size = " x ".join(f"{side:g}" for side in reflector.body)
    cells = f"whose cells are {shape.cell_size:g} mm wide and {shape.top_of_cell:g} mm high"
    remedy = f"{room_needed(shape, corners)}; or move it"
    grids = [(array.rows, array.columns, array.pitch) for array in (reflector, shape)]
    if grids[0] != grids[1]:
        reflector_grid, cell_grid = (f"{rows} x {columns} at {pitch:g} mm" for rows, columns, pitch in grids)
        remedy = f"its array is {reflector_grid}, that of the cells {cell_grid}"
    return body.obj.finding(
        "error",
        f"package {index + 1} of photo_reflector, {size} mm, stands in the silicone of the {PAD}, {cells}: {remedy}.",
    )


def _other_pitch(body: Boxes, pad: SceneObject) -> Iterator[Finding]:
    shape, reflector = pad.instance.pad, body.obj.instance
    comparable = (reflector.rows > 1 and shape.rows > 1) or (reflector.columns > 1 and shape.columns > 1)
    scale = np.cbrt(np.linalg.det(body.to_world[:3, :3]) / np.linalg.det(pad.instance.to_world[:3, :3]))
    pitch = scale * reflector.pitch
    if comparable and abs(pitch - shape.pitch) > 1e-4 * shape.pitch:
        message = f"pitch = {pitch:g} of photo_reflector is not that of the {PAD}, {shape.pitch:g}"
        advice = "packages are not centred in their cells; make both equal"
        yield body.obj.finding("warning", f"{message}: {advice}.", "pitch")


def _cells_not_read(body: Boxes, pad: SceneObject, numbers: np.ndarray) -> Iterator[Finding]:
    """Warn of packages in cells whose surface is triangulated coarsely, as they are not read."""
    unread = sorted(set(numbers.tolist()) - set(pad.instance.read_cells or numbers.tolist()))
    if unread:
        message = f"read_cells leaves out cell {', '.join(map(str, unread))}, where a photo_reflector stands"
        yield pad.finding("warning", f"{message}: add it, or its triangles are too large.", "read_cells")
