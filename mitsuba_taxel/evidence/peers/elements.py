"""Comparison with CalculiX on the same meshes: time, mean displacement of the roof, and agreement with the
implementation of its element in `displacement_form`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.evidence.peers import calculix, displacement_form
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_slopes
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.materials.laws import NeoHookean
from mitsuba_taxel.pads import REGIONS, Pad, mesh_pad

PAD = Pad("parallelepiped")
CELL = 5
MESH_SIZES = (1.2, 0.8, 0.65, 0.55)
POISSON_RATIOS = (0.3, 0.49, 0.4999)
FORCE = (0.0, 0.0, -20.0)
THREADS = (1, 2)
COLUMNS = ("nu", "mesh size", "unknowns", "threads", "seconds", "increments", "iterations", "roof mm", "difference mm")


def table(mesh_sizes: Sequence[float], poisson_ratios: Sequence[float]) -> Iterator[tuple[object, ...]]:
    """Compare CalculiX with this package for several meshes and Poisson's ratios, and yield rows with the columns
    :data:`COLUMNS`.

    Parameters
    ----------
    mesh_sizes : sequence of float
        Mesh sizes in mm.
    poisson_ratios : sequence of float
        Poisson's ratios, below 0.5.

    Raises
    ------
    ComputationError
        if CalculiX is not installed.
    """
    calculix.require()
    for poisson_ratio in poisson_ratios:
        for mesh_size in mesh_sizes:
            yield from rows_of(NeoHookean(poisson_ratio=poisson_ratio), mesh_size)


def rows_of(material: NeoHookean, mesh_size: float) -> Iterator[tuple[object, ...]]:
    """Compare CalculiX with this package on one mesh, and yield the rows. If CalculiX fails, its row gives the reason.

    Parameters
    ----------
    material : NeoHookean
        The law.
    mesh_size : float
        Mesh size in mm.
    """
    mesh = mesh_pad(PAD, mesh_size)
    unknowns = 3 * np.count_nonzero(~displacement_form.held(mesh))
    ours = _own_displacement(mesh, material)
    for threads in THREADS:
        case = (material.poisson_ratio, mesh_size, unknowns, threads)
        try:
            result = calculix.solve(mesh, material, FORCE, threads)
        except ComputationError as reason:
            yield *case, str(reason), *[""] * (len(COLUMNS) - len(case) - 1)
            continue
        roof = mean_roof_displacement(mesh, result.displacement, CELL)
        difference = np.abs(result.displacement - ours).max()
        figures = (f"{result.seconds:.2f}", result.increments, result.iterations, f"{roof:.6f}", f"{difference:.1e}")
        yield *case, *figures


def mean_roof_displacement(mesh: VolumeMesh, displacement: np.ndarray, cell: int) -> float:
    """Mean displacement along z of the roof of a cell, in mm, weighted by undeformed area.

    The mean is exact for flat roofs, also with curved edges: each triangle is mapped to a square with 5 x 5
    Gauss-Legendre nodes (M. G. Duffy, SIAM J. Numer. Anal. 19, 1982).

    Parameters
    ----------
    mesh : VolumeMesh
        The undeformed mesh.
    displacement : (N, 3) ndarray
        Displacement of each of N nodes, mm.
    cell : int
        Number of the cell, from 1.
    """
    roof = mesh.faces[(mesh.face_region == REGIONS["roof"]) & (mesh.face_cell == cell)]
    nodes, weights = np.polynomial.legendre.leggauss(5)
    u, v = (side.ravel() for side in np.meshgrid(0.5 * (1 + nodes), 0.5 * (1 + nodes), indexing="ij"))
    second, third = u, (1 - u) * v
    barycentric = np.stack([1 - second - third, second, third], axis=1)
    shapes = shape_functions(barycentric)
    tangents = [np.einsum("qa,fai->fqi", slopes, mesh.points[roof]) for slopes in shape_slopes(barycentric)]
    area = np.linalg.norm(np.cross(*tangents), axis=-1) * np.outer(weights, weights).ravel() * (1 - u)
    return float(np.sum(area * (displacement[roof, 2] @ shapes.T)) / area.sum())


def _own_displacement(mesh: VolumeMesh, material: NeoHookean) -> np.ndarray:
    """Displacement (N, 3) in mm by the element in `displacement_form`; NaN if it fails."""
    try:
        return displacement_form.solve(mesh, material, FORCE)
    except ComputationError:
        return np.full(mesh.points.shape, np.nan)
