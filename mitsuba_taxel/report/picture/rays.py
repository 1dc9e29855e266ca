"""Pictures of light paths, and their export in VTK format."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.base.files.atomic import replacing, write_text
from mitsuba_taxel.plots.figures import axes_of
from mitsuba_taxel.sensing.validity.ray_paths import RayPaths, find_taxel

if TYPE_CHECKING:
    import mitsuba as mi
    from matplotlib.axes import Axes
    from trimesh import Trimesh

    from mitsuba_taxel.kernels.taxels.faces import FaceGrid

PICTURES = (".png", ".svg", ".pdf")
REACHED, OTHER, OUTLINE, LED, PHOTOTRANSISTOR = "#0072B2", "#9A9A9A", "#000000", "#D55E00", "#009E73"
"""Palette of M. Okabe and K. Ito, distinguishable with any colour vision; line widths differ too."""


def plot_paths(scene: mi.Scene, paths: RayPaths, name: str, file: Path) -> None:
    """Write a picture of the light paths of a taxel, seen along y and along x, in mm.

    The section of the scene's surfaces with the plane through the taxel's centre is black; paths are projected onto
    that plane. The view contains all paths that reach the phototransistor, and nearly all others.

    Parameters
    ----------
    scene : mi.Scene
        The scene of the paths.
    paths : RayPaths
        Paths of a taxel, in mm.
    name : str
        Name of the scene in the title.
    file : Path
        File of the picture, which is replaced if it exists.
    """
    meshes = [mesh for shape in scene.shapes() if (mesh := shape_mesh(shape)) is not None]
    pair, index = find_taxel(scene, paths.taxel)
    faces = {"LED": (face_corners(pair.led.window.faces, index), LED)}
    faces["phototransistor"] = (face_corners(pair.sensor.window.faces, index), PHOTOTRANSISTOR)
    centre = np.mean([corners for corners, _ in faces.values()], axis=(0, 1))
    box = _view(paths, faces)
    width, depth, height = box[1] - box[0]
    inches = min(5.0 * height / max(width, depth), 10.0) + 1.6
    ratios = {"width_ratios": (width, depth)}
    axes = axes_of((11, inches), 1, 2, gridspec_kw=ratios)[0]
    for ax, across in zip(axes, (1, 0), strict=True):
        _draw_panel(ax, across, paths, meshes, faces, centre)
        along = 1 - across
        ax.set(xlim=box[:, along], ylim=box[:, 2], aspect="equal", xlabel=f"{'xy'[along]} [mm]", ylabel="z [mm]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure = axes[0].figure
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    arrive = f"{paths.arrived} of {paths.drawn} paths drawn reach the phototransistor"
    figure.suptitle(f"{name}, taxel {paths.taxel}: {arrive}")
    with replacing(file) as temporary:
        figure.savefig(temporary, format=file.suffix[1:].lower())


def write_vtk(paths: RayPaths, file: Path) -> None:
    """Write paths as polylines in VTK's legacy format, in mm, with ``reached`` (0 or 1) and ``power`` (W) for each.

    Source: The VTK User's Guide, chapter "VTK File Formats".

    Parameters
    ----------
    paths : RayPaths
        Paths of a taxel, in mm and W.
    file : Path
        Output file, which is replaced if it exists.

    Raises
    ------
    WriteError
        if the file cannot be written.
    """
    lengths = [len(path) for path in paths.vertices]
    starts = np.cumsum([0, *lengths[:-1]])
    lines = [
        "# vtk DataFile Version 3.0",
        f"light paths of taxel {paths.taxel}; mm, W",
        "ASCII",
        "DATASET POLYDATA",
        f"POINTS {sum(lengths)} double",
        *(f"{x:.9g} {y:.9g} {z:.9g}" for path in paths.vertices for x, y, z in path),
        f"LINES {len(lengths)} {sum(lengths) + len(lengths)}",
        *(
            " ".join(map(str, (length, *range(start, start + length))))
            for start, length in zip(starts, lengths, strict=True)
        ),
        f"CELL_DATA {len(lengths)}",
        "SCALARS reached int 1",
        "LOOKUP_TABLE default",
        *(str(int(reached)) for reached in paths.reached),
        "SCALARS power double 1",
        "LOOKUP_TABLE default",
        *(f"{power:.9g}" for power in paths.power),
    ]
    write_text(file, "\n".join(lines) + "\n")


def _draw_panel(ax: Axes, across: int, paths: RayPaths, meshes: list[Trimesh], faces: dict, centre: np.ndarray) -> None:
    """Draw the view along axis ``across``: paths first, surfaces above them."""
    from matplotlib.collections import LineCollection

    seen = [1 - across, 2]
    for reached, colour, width, label in (
        (False, OTHER, 0.4, "other paths"),
        (True, REACHED, 0.7, "paths that reach the phototransistor"),
    ):
        chosen = [path[:, seen] for path, here in zip(paths.vertices, paths.reached, strict=True) if here == reached]
        ax.add_collection(LineCollection(chosen, colors=colour, linewidths=width, alpha=0.7, label=label))
    outline = np.concatenate([_section(mesh, across, centre) for mesh in meshes])[:, :, seen]
    ax.add_collection(LineCollection(list(outline), colors=OUTLINE, linewidths=1.2, label="section", zorder=3))
    for label, (corners, colour) in faces.items():
        low, high = corners[:, seen].min(axis=0), corners[:, seen].max(axis=0)
        ends = np.stack([low, high])
        # Along y, LED and phototransistor lie behind each other; the wider face extends beyond the narrower.
        ax.plot(
            *ends.T, color=colour, linewidth=5 if label == "LED" else 3, solid_capstyle="butt", label=label, zorder=4
        )


def _section(mesh: Trimesh, across: int, centre: np.ndarray) -> np.ndarray:
    """Segments (S, 2, 3) in which a mesh intersects the plane through ``centre`` normal to an axis."""
    import trimesh

    normal = np.eye(3)[across]
    # A plane of symmetry often contains edges of the mesh; slightly beside it, each triangle is cut cleanly.
    origin = centre + 1e-6 * np.ptp(mesh.bounds, axis=0).max() * normal
    return trimesh.intersections.mesh_plane(mesh, normal, origin)


def shape_mesh(shape: mi.Shape) -> Trimesh | None:
    """A shape as a triangle mesh; None if it has no triangles."""
    import mitsuba as mi
    import trimesh

    if shape.class_name() == "Rectangle":
        corners = np.array([[-1, -1, 0, 1], [1, -1, 0, 1], [1, 1, 0, 1], [-1, 1, 0, 1]], dtype=float)
        matrix = np.array(mi.traverse(shape)["to_world"].matrix, dtype=float).reshape(4, 4)
        return trimesh.Trimesh((corners @ matrix.T)[:, :3], [[0, 1, 2], [0, 2, 3]], process=False)
    if not shape.is_mesh():
        return None
    parameters = mi.traverse(shape)
    vertices = np.array(parameters["vertex_positions"], dtype=float).reshape(-1, 3)
    return trimesh.Trimesh(vertices, np.array(parameters["faces"]).reshape(-1, 3), process=False)


def face_corners(faces: FaceGrid, index: int) -> np.ndarray:
    """Corners (4, 3) of a face, in mm."""
    import mitsuba as mi

    half = 0.5 * np.array(faces.size).ravel()
    offset = mi.Point2f(half[0] * mi.Float([-1, 1, 1, -1]), half[1] * mi.Float([-1, -1, 1, 1]))
    return np.array(faces.point(mi.UInt32(index), offset)).T.astype(float)


def _view(paths: RayPaths, faces: dict) -> np.ndarray:
    """Region of the picture: lower and upper corner (2, 3) in mm. A few long paths are cut off, because they would make
    the others small."""
    corners = np.concatenate([corners for corners, _ in faces.values()])
    points = np.concatenate(paths.vertices)
    kept = [path for path, reached in zip(paths.vertices, paths.reached, strict=True) if reached]
    shown = np.concatenate([corners, np.percentile(points, (2, 98), axis=0), *kept])
    low, high = shown.min(axis=0), shown.max(axis=0)
    margin = 0.08 * (high - low).max()
    return np.stack([low - margin, high + margin])
