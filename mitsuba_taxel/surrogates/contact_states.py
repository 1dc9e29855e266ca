"""Full solutions of balls and rods on a pad, by finite elements and light, to which the second-order terms of a contact
model are fitted."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import qmc

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.surrogates.contact_readings import ContactModel

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import Indenter
    from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells

SMALLEST, SPREAD = 3.0, 4.0
"""Smallest radius of a body, in patches, and the ratio of the largest to the smallest radius."""
STEEP = 1.5
"""Smallest radius of a body, relative to the largest depth."""
WITHIN = 0.6
"""Range of the places of bodies, relative to the top."""
SHALLOW, HALFWAY = 0.3, 0.5
"""Smallest final depth of a body, relative to the largest; and depth of its first state, relative to the final one."""
BESIDE = 0.1
"""Allowed distance of the nodes of one mesh from the elements of another, relative to the height of the pad."""
RODS = 0.35
"""Fraction of the bodies that are rods."""


@dataclass(frozen=True)
class Touch:
    """A ball or rod at a position on the pad, pressed in without friction.

    Attributes
    ----------
    kind : str
        `sphere`, or `cylinder` for a rod that lies across the whole pad.
    radius : float
        Radius in mm.
    x, y : float
        Position of its lowest point in mm.
    angle : float
        Angle of a rod to the x axis in degrees.
    depth : float
        Final depth below the undeformed top in mm.
    """

    kind: str
    radius: float
    x: float
    y: float
    angle: float
    depth: float

    @property
    def depths(self) -> tuple[float, float]:
        """Depths in mm of the two states that are solved for this body."""
        return HALFWAY * self.depth, self.depth

    def below(self, points: np.ndarray, depth: float) -> np.ndarray:
        """Depth (...) in mm of the body's surface below the undeformed top, at points (..., 3) of the top. At points
        beside the body it is the depth minus the radius.
        """
        x, y = points[..., 0] - self.x, points[..., 1] - self.y
        turn = np.radians(self.angle)
        across = y * np.cos(turn) - x * np.sin(turn) if self.kind == "cylinder" else np.hypot(x, y)
        sagitta = self.radius - np.sqrt(np.maximum(self.radius**2 - across**2, 0.0))
        return np.where(np.abs(across) < self.radius, depth - sagitta, depth - self.radius)

    def indenter(self) -> Indenter:
        """The body as an indenter of the finite elements."""
        from mitsuba_taxel.mechanics import Indenter

        body = Indenter(self.kind, radius=self.radius, at=(self.x, self.y))
        return replace(body, angle=self.angle) if self.kind == "cylinder" else body


@dataclass(frozen=True)
class SolvedTouch:
    """A body that presses on the pad, and the full solutions of its two states.

    Attributes
    ----------
    touch : Touch
        The body.
    power : list of list of float
        Readings in W of each state.
    force, moment : list of list of float
        Force in N and moment in N mm, about the centre of the pad's bottom, of the body on the pad, for each state.
    """

    touch: Touch
    power: list[list[float]]
    force: list[list[float]]
    moment: list[list[float]]


def touches(model: ContactModel, count: int, seed: int = 0) -> list[Touch]:
    """Choose balls and rods that cover the range of a contact model: the first ``count`` members of a Halton sequence.

    Parameters
    ----------
    model : ContactModel
        The model.
    count : int
        Number of bodies.
    seed : int
        Seed of the sequence.

    Returns
    -------
    list[Touch]
        Bodies; a larger count adds to the same ones.
    """
    numbers = qmc.Halton(6, seed=seed).random(count)
    half = 0.5 * WITHIN * np.array([len(model.x) * model.size[0], len(model.y) * model.size[1]])
    middle = np.array([model.x.mean(), model.y.mean()])
    smallest = max(SMALLEST * max(model.size), STEEP * model.largest_depth)
    chosen = []
    for kind, radius, x, y, angle, depth in numbers:
        place = middle + half * (2 * np.array([x, y]) - 1)
        is_rod = kind < RODS
        chosen.append(
            Touch(
                "cylinder" if is_rod else "sphere",
                round(float(smallest * SPREAD**radius), 4),
                round(float(place[0]), 4),
                round(float(place[1]), 4),
                round(180 * float(angle), 2) if is_rod else 0.0,
                round(float(model.largest_depth * (SHALLOW + (1 - SHALLOW) * depth)), 4),
            )
        )
    return chosen


def solved_touch(cells: DiffuseCells, touch: Touch) -> SolvedTouch:
    """Solve a body on a pad in full: by finite elements at large strains, and the light in the deformed cells.

    Parameters
    ----------
    cells : DiffuseCells
        Cells of a loaded scene with one pad; its vertices are moved, and moved back.
    touch : Touch
        The body.

    Returns
    -------
    SolvedTouch
        The solutions.

    Raises
    ------
    ComputationError
        if the path ends before the depth, as where a roof touches a package, or the light is occluded.
    """
    from mitsuba_taxel.mechanics import IndenterDisplacement, displacement_at, load_path, reactions
    from mitsuba_taxel.sensing.derivatives.wall_gradient import WallGradient
    from mitsuba_taxel.sensing.reading.mechanics_error import move, restored

    pad, power, force, moment = cells.pad, [], [], []
    values = [(0.0, 0.0, -depth) for depth in touch.depths]
    load = IndenterDisplacement(touch.indenter())
    for state in load_path(pad.pad, pad.material, values, load=load, mesh_size=pad.mesh_size):
        light, balance = WallGradient(cells, state), reactions(state)
        with restored(cells.scene, [pad]):
            # The triangles of the scene belong to its own elements.
            own = pad.state.mesh.points
            displacement = displacement_at(state.mesh, state.displacement, own, BESIDE * np.ptp(own[:, 2]))
            move(cells.scene, [pad], [pad.moved_places(replace(pad.state, displacement=displacement), pad.pad)])
            light.refuse_occluded()
        power.append(light.power.tolist())
        force.append(balance.applied_force.tolist())
        moment.append(balance.applied_moment.tolist())
    return SolvedTouch(touch, power, force, moment)


class StateFile:
    """JSON file of the bodies that have been solved. It is rewritten after each body, so that an interrupted run can be
    resumed.

    Parameters
    ----------
    file : Path or None
        The file; None to keep them in memory only.
    model : ContactModel
        Contact model of the pad; a file of another pad is refused.

    Raises
    ------
    InputError
        if the file holds the states of another pad, or is damaged.
    """

    def __init__(self, file: Path | None, model: ContactModel) -> None:
        self._file, self._key = file, _digest(model)
        self._solved: dict[Touch, SolvedTouch | str] = {}
        if file is None or not file.exists():
            return
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
            key = content["pad"]
            for row in content["touches"]:
                touch = Touch(**row["touch"])
                results = [row[name] for name in ("power", "force", "moment")] if "power" in row else []
                self._solved[touch] = SolvedTouch(touch, *results) if results else row["failed"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{file} holds no states of a contact model: remove it, or name another.") from error
        if key != self._key:
            raise InputError(f"{file} holds the states of another pad: remove it, or name another output.")

    def of(self, touch: Touch, solve: Callable[[Touch], SolvedTouch]) -> SolvedTouch | str:
        """Solutions for a body: from the file, or computed by ``solve``. If the computation fails, the reason is
        returned as text.
        """
        if touch not in self._solved:
            try:
                self._solved[touch] = solve(touch)
            except ComputationError as error:
                self._solved[touch] = str(error)
            self._write()
        return self._solved[touch]

    def _write(self) -> None:
        if self._file is None:
            return
        rows: list[dict[str, Any]] = []
        for touch, solved in self._solved.items():
            row: dict[str, Any] = {"touch": vars(touch)}
            if isinstance(solved, str):
                row["failed"] = solved
            else:
                row |= {"power": solved.power, "force": solved.force, "moment": solved.moment}
            rows.append(row)
        units = {"radius, x, y, depth": "mm", "angle": "degrees", "power": "W", "force": "N", "moment": "N mm"}
        write_text(self._file, json.dumps({"pad": self._key, "units": units, "touches": rows}, indent=1))


def _digest(model: ContactModel) -> str:
    """Digest of the readings and the compliance of a pad at rest, rounded so that it does not depend on the machine."""
    numbers = np.concatenate([model.rest, model.compliance.diagonal(), model.gradient.sum(axis=1)])
    return sha256(" ".join(f"{number:.6e}" for number in numbers).encode()).hexdigest()[:16]
