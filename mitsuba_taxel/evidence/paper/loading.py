"""The pad under load: the paper's Figs. 9 and 10 and Table 1, for all four cell shapes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.evidence.paper.scenes import POISSON_RATIO, YOUNGS_MODULUS
from mitsuba_taxel.mechanics import NeoHookean, displacement_at, load_path
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.studies import sweep

SCENE = "pad.xml"
TARGET_ERROR, TARGET_SLOPE = 0.005, 0.02
DIAGONAL_POINTS = 5
FURTHEST = 30.0
"""Tangential force in N above what any shape bears at -8 N."""
PATHS = ("fz", "fx", "fy", "resultant")
"""Dimensions along which forces vary: normal, tangential along x, y and the secondary diagonal."""


def nominal(store: PaperStudies, cell: str) -> dict[str, xr.Dataset]:
    """Compute readings of nine taxels along the four load paths of the paper; the keys are the names of the paths in
    :data:`PATHS`."""
    paths = {"fz": normal(store, cell), "fx": along_x(store, cell), "fy": along_y(store, cell)}
    return {**paths, "resultant": along_diagonal(store, cell)}


def normal(store: PaperStudies, cell: str) -> xr.Dataset:
    """Compute readings of a pad under normal forces. Force steps, mesh and number of light paths are chosen for target
    errors.
    """
    targets: dict[str, Any] = {"target_error": TARGET_ERROR, "target_slope": TARGET_SLOPE}
    vary = {"fz": f"0:{-paper.NORMAL_FORCE}"}
    return store.study(
        f"nominal/{cell}_fz", {"vary": vary, **targets}, lambda: sweep(SCENE, vary, {"cell": cell}, **targets)
    )


def along_x(store: PaperStudies, cell: str) -> xr.Dataset:
    """Compute readings of a pad under tangential forces along x, with the settings of :func:`normal` if the errors of
    the slopes allow it.
    """
    return _along_side(store, cell, "fx", settings_of(normal(store, cell)))


def along_y(store: PaperStudies, cell: str) -> xr.Dataset:
    """Compute readings of a pad under tangential forces along y, with the settings of :func:`along_x`."""
    return _along_side(store, cell, "fy", settings_of(along_x(store, cell)))


def _along_side(store: PaperStudies, cell: str, path: str, settings: dict[str, Any]) -> xr.Dataset:
    vary = {path: f"0:{paper.TANGENTIAL_LIMIT[cell]}"}
    return store.study(
        f"nominal/{cell}_{path}",
        {"vary": vary, "target_slope": TARGET_SLOPE, **settings},
        lambda: sweep(SCENE, vary, _pressed(cell), target_slope=TARGET_SLOPE, **settings),
    )


def along_diagonal(store: PaperStudies, cell: str) -> xr.Dataset:
    """Compute readings of a pad under tangential forces along the secondary diagonal, over the magnitude of the force.
    """
    forces = np.linspace(0, paper.TANGENTIAL_LIMIT[cell], DIAGONAL_POINTS)
    settings = settings_of(along_x(store, cell))
    return _tangential(store, f"nominal/{cell}_resultant", cell, "resultant", forces, settings)


def settings_of(study: xr.Dataset) -> dict[str, Any]:
    """Number of points and mesh size of a study, as arguments for another study with the same settings."""
    mesh_size = study.attrs.get("mesh_size")
    return {"points": int(study.attrs["points"]) or None, "mesh_size": None if mesh_size is None else float(mesh_size)}


def beyond(store: PaperStudies, cell: str) -> dict[str, xr.Dataset]:
    """Compute readings under tangential forces above the paper's limit, in steps of 1 N, up to the end of each load
    path.

    The mesh and the number of light paths are those of the study :func:`normal`, which is computed if missing. The
    studies of smaller tangential forces, such as :func:`along_x`, may have a finer mesh and more light paths. The
    attribute ``failures`` of each study gives the reason why its load path ends; its first line is the first failure.

    Parameters
    ----------
    store : PaperStudies
        Stored studies of the paper's sensor.
    cell : str
        Shape of the cells.

    Returns
    -------
    dict[str, Dataset]
        The loads at which the readings of all taxels could be computed, by the name of the load path.
    """
    settings = settings_of(normal(store, cell))
    forces = np.arange(paper.TANGENTIAL_LIMIT[cell], FURTHEST + 1)
    studies = {}
    for path in PATHS[1:]:
        study = _tangential(store, f"beyond/{cell}_{path}", cell, path, forces, settings)
        studies[path] = study.isel({path: np.isfinite(study.power.values).all(axis=study.power.get_axis_num("taxel"))})
    return studies


def _tangential(
    store: PaperStudies, name: str, cell: str, path: str, forces: np.ndarray, settings: dict[str, Any]
) -> xr.Dataset:
    """Compute readings under tangential forces, over their resultant in N, at the paper's normal force."""

    def compute() -> xr.Dataset:
        if path != "resultant":
            return sweep(SCENE, {path: forces.tolist()}, _pressed(cell), derivatives=(path,), **settings)
        components = (forces / math.sqrt(2)).tolist()
        rows = {"fx": components, "fy": components}
        study = sweep(SCENE, {}, _pressed(cell), together=rows, derivatives=tuple(rows), **settings)
        diagonal = study.assign_coords(resultant=("step", forces, {"units": "N"}))
        return diagonal.swap_dims(step="resultant").drop_vars("step")

    return store.study(name, {"forces": forces.tolist(), **settings}, compute)


def _pressed(cell: str) -> dict[str, Any]:
    return {"cell": cell, "fz": -paper.CONSTANT_NORMAL_FORCE}


def roof_heights(store: PaperStudies, cell: str) -> xr.Dataset:
    """Compute the displacement along z of the roof of each cell in mm, at -8 N without and with 8 N along the secondary
    diagonal.

    The dataset has the variables ``normal`` and ``diagonal`` over ``taxel``. The mesh is that of
    :func:`along_diagonal`.
    """
    mesh_size = settings_of(along_diagonal(store, cell))["mesh_size"]

    def compute() -> xr.Dataset:
        pad, silicone = Pad(cell), NeoHookean(YOUNGS_MODULUS, POISSON_RATIO)
        component = paper.SHOWN_TANGENTIAL_FORCE / math.sqrt(2)
        normal = -paper.CONSTANT_NORMAL_FORCE
        states = load_path(pad, silicone, [(0, 0, normal), (component, component, normal)], mesh_size=mesh_size)
        tops = np.column_stack([pad.cell_centres, np.full(len(pad.cell_centres), pad.top_of_cell)])
        displacements = [displacement_at(state.mesh, state.displacement, tops)[:, 2] for state in states]
        return xr.Dataset(
            {
                name: ("taxel", z, {"units": "mm"})
                for name, z in zip(("normal", "diagonal"), displacements, strict=True)
            },
            coords={"taxel": np.arange(1, len(tops) + 1)},
        )

    return store.study(f"roofs/{cell}", {"mesh_size": mesh_size}, compute)
