"""Creation of a contact model from a scene: from the compliance of its pad and the derivatives of its readings, both at
rest."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.base.arguments import check_flags, check_progress, is_number, refusal, require
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.surrogates.contact_readings import ContactModel

if TYPE_CHECKING:
    from mitsuba_taxel.kernels.protocols import PadShape
    from mitsuba_taxel.mechanics.derivatives.top_compliance import TopGrid
    from mitsuba_taxel.sensing import Scene

ALONG = 15
"""Default number of patches along the longer side of the top."""
ELEMENTS = 1.3
"""Size of the finite elements, relative to that of the patches: patches much smaller than elements have nearly the same
displacements, and their compliance is nearly singular."""


def contact_model(
    scene: Scene,
    depth: float,
    *,
    spacing: float | None = None,
    mesh_size: float | None = None,
    friction: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> ContactModel:
    """Create a linear contact model: the readings of a pad under bodies of any shape that press on its top.

    Readings are linear in the contact forces. The top is divided into patches. For each patch, one back-solve with the
    factored stiffness matrix gives the displacements by a force on it. The changes of the readings follow from these
    displacements and the derivatives of the light with respect to the walls.

    Parameters
    ----------
    scene : Scene
        A scene with one elastic pad at rest, whose top is a plane, and diffuse cells.
    depth : float
        Largest depth of a body, in mm, for which the model is used.
    spacing : float, optional
        Approximate side of the patches in mm; by default a fifteenth of the longer side of the top. At most a third of
        the radius of the smallest contact is needed.
    mesh_size : float, optional
        Size of the finite elements in mm; by default 1.3 times that of the patches.
    friction : bool
        Whether forces along x and y on each patch are solved, too, for `FrictionPads`; this takes about four times as
        long.
    progress : Callable[[int, int], None], optional
        Called with (forces done, all forces): one on each patch, and three with friction.

    Returns
    -------
    ContactModel
        The model.

    Raises
    ------
    InputError
        if the scene has no such pad, or its light needs random paths.
    ComputationError
        if the light of the cells is not resolved, or walls occlude it.
    """
    from mitsuba_taxel.mechanics import SpreadForce, linearise, load_path
    from mitsuba_taxel.mechanics.derivatives.top_compliance import patch_responses, top_grid
    from mitsuba_taxel.sensing import Scene
    from mitsuba_taxel.sensing.derivatives.wall_gradient import WallGradient
    from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells

    require("scene", scene, Scene, "a Scene")
    check_progress(progress)
    check_flags(friction=friction)
    for name, value in {"depth": depth, "spacing": spacing, "mesh_size": mesh_size}.items():
        optional = value is None and name != "depth"
        if not (optional or (value is not None and is_number(value) and value > 0)):
            raise refusal(name, value, "a finite length in mm above 0 is needed")

    # The pad at rest with a free top, on elements of about the size of the patches.
    cells = DiffuseCells(scene.load())
    pad = cells.pad
    _refuse_other_pads(pad)
    spacing = spacing or float(np.ptp(pad.state.mesh.points[:, :2], axis=0).max()) / ALONG
    state = load_path(
        pad.pad, pad.material, [(0.0, 0.0, 0.0)], load=SpreadForce(), mesh_size=mesh_size or ELEMENTS * spacing
    )[0]
    grid, weights = top_grid(state.mesh, spacing)
    light = WallGradient(cells, state)
    light.refuse_occluded()
    if dark := np.flatnonzero(light.power <= 0).tolist():
        raise InputError(f"taxel {dark[0] + 1} receives no light at rest, so that its reading has no relative change.")

    # One back-solve for each patch gives its column of the compliance, and its part of the gradient.
    linear, compliance, gradient, lateral = linearise(state), [], [], []
    done, forces = 0, weights.shape[0] * (3 if friction else 1)
    for displacement in patch_responses(linear, weights):
        compliance.append(-(weights @ displacement[:, 2]))
        gradient.append(light.along(displacement))
        lateral.append(weights @ displacement[:, :2])
        done += 1
        if progress is not None:
            progress(done, forces)
    matrix, tangential, tangential_gradient = np.array(compliance), None, None
    if friction:
        # Sideways forces bend roofs inwards on one side and outwards on the other: the mean of both directions.
        moves, changes = [], []
        for direction in np.eye(3)[:2]:
            for displacement in patch_responses(linear, weights, direction):
                moves.append(weights @ displacement[:, :2])
                changes.append(0.5 * (light.along(displacement) - light.along(-displacement)))
                done += 1
                if progress is not None:
                    progress(done, forces)
        patches = weights.shape[0]
        sideways = np.array(moves).transpose(2, 1, 0).reshape(2 * patches, 2 * patches)
        tangential = (0.5 * (sideways + sideways.T)).reshape(2, patches, 2, patches)
        tangential_gradient = np.array(changes).T.reshape(-1, 2, patches)
    return ContactModel(
        x=grid.x,
        y=grid.y,
        size=grid.size,
        height=grid.height,
        covered=grid.covered,
        compliance=0.5 * (matrix + matrix.T),
        rest=light.power,
        gradient=np.array(gradient).T,
        largest_depth=float(depth),
        places=_inner_places(grid),
        lateral=np.array(lateral).transpose(2, 1, 0),
        tangential=tangential,
        tangential_gradient=tangential_gradient,
    )


def _inner_places(grid: TopGrid) -> np.ndarray:
    """Range (2, 2) in mm of the centres of all patches that are not at the rim: lowest x and y, then highest x and y.
    """
    half = np.array(grid.size)
    low, high = np.array([grid.x[0], grid.y[-1]]) + 0.5 * half, np.array([grid.x[-1], grid.y[0]]) - 0.5 * half
    return np.array([low, high])


def _refuse_other_pads(pad: PadShape) -> None:
    """Raise `InputError` for a pad whose contact cannot be described by a contact model."""
    if pad.is_loaded:
        raise InputError("a contact model starts from the pad at rest: set the load of the scene to 0.")
    for name in ("prony", "mullins"):
        if getattr(pad, name):
            raise InputError(f"a contact model has no memory: remove {name} from the pad.")
    if pad.load.self_contact:
        raise InputError("a contact model leaves out contact of the pad with itself: remove self_contact.")
    if pad.load.indenter is not None and pad.load.indenter.friction:
        raise InputError(
            "a contact model leaves out the friction of the scene's indenter: remove indenter_friction. "
            "FrictionPads has friction, for models made with friction=True."
        )
