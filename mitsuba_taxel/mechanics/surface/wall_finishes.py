"""Surface finishes of the walls of a pad: which wall has which finish, which finishes are refused, and the rough
surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.base.arguments import refusal
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.surface.finish import Finish, Grooves, LayerSteps, RandomRoughness
from mitsuba_taxel.mechanics.surface.layers import ALONG
from mitsuba_taxel.mechanics.surface.relief import Relief, SmoothSurface
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.pads.regions import REGIONS

MOST_TRIANGLES = 20_000_000
LARGEST_AMPLITUDE = 0.5
"""Largest displacement of a wall, relative to the smallest distance to another wall."""
KINDS = (LayerSteps, Grooves, RandomRoughness)
"""Finishes in the order in which they are applied: steps cut the smooth walls, random heights move vertices."""


@dataclass(frozen=True)
class SeparateFinish:
    """Different finishes of roof and side of the cells.

    Parameters
    ----------
    roof, side : LayerSteps or Grooves or RandomRoughness, optional
        Finish of the wall; None is smooth. The two are of different kinds: one mould is printed with one layer height.

    Raises
    ------
    InputError
        if a finish is of another type, or both are of the same kind.
    """

    roof: LayerSteps | Grooves | RandomRoughness | None = None
    side: LayerSteps | Grooves | RandomRoughness | None = None

    def __post_init__(self) -> None:
        for name, finish in (("roof", self.roof), ("side", self.side)):
            if finish is not None and not isinstance(finish, KINDS):
                raise refusal(name, finish, "LayerSteps, Grooves, RandomRoughness or None is needed")
        if type(self.roof) is type(self.side):
            raise refusal(
                "SeparateFinish",
                (self.roof, self.side),
                "finishes of two kinds, or one finish and None, are needed; one finish of both walls is given alone",
            )


def by_walls(finish: Finish | SeparateFinish) -> list[tuple[Finish, tuple[str, ...]]]:
    """The finishes of a mould by region of the walls, in the order in which they are applied.

    Parameters
    ----------
    finish : Finish or SeparateFinish
        Finish of the mould.

    Returns
    -------
    list[tuple[Finish, tuple[str, ...]]]
        Each finish, and the regions that have it.
    """
    if not isinstance(finish, SeparateFinish):
        return [(finish, ("roof", "side"))]
    walls: list[tuple[Finish, tuple[str, ...]]] = [
        (kind, (name,)) for name, kind in (("roof", finish.roof), ("side", finish.side)) if kind is not None
    ]
    return sorted(walls, key=lambda wall: [isinstance(wall[0], kind) for kind in KINDS].index(True))


def with_blunt_heights(finish: Finish | SeparateFinish | None) -> Finish | SeparateFinish | None:
    """A finish whose random heights are less steep; the change of the readings gives the error due to flat triangles.

    Parameters
    ----------
    finish : Finish or SeparateFinish or None
        Finish of the mould.

    Returns
    -------
    Finish or SeparateFinish or None
        The finish with `BluntHeights`; None if it has no random heights.
    """
    if isinstance(finish, RandomRoughness):
        return finish.blunt
    if isinstance(finish, SeparateFinish):
        for name, wall in (("roof", finish.roof), ("side", finish.side)):
            if isinstance(wall, RandomRoughness):  # at most one: both walls have different kinds
                return replace(finish, **{name: wall.blunt})
    return None


def relief_of(finish: Finish | SeparateFinish, smooth: SmoothSurface) -> Relief:
    """The rough surface of a pad with a finish.

    Parameters
    ----------
    finish : Finish or SeparateFinish
        Finish of the mould.
    smooth : SmoothSurface
        The undeformed surface.

    Returns
    -------
    Relief
        Rough surface, relative to ``smooth``.
    """
    (first, walls), *others = by_walls(finish)
    relief = first.relief(smooth.with_rough(walls))
    # A further finish is applied to the surface that is already rough on the other wall.
    for other, walls in others:
        vertices = relief.between(smooth.vertices) + relief.offset
        surface = replace(
            smooth, vertices=vertices, triangles=relief.triangles, region=smooth.region[relief.parents]
        ).with_rough(walls)
        relief = relief.then(other.relief(surface))
    return relief


def has_vertical_sides(pad: Pad) -> bool:
    """Whether the sides of the cells of a pad are vertical all around."""
    inwards, down = pad.shape.wall_tangents()[0]
    return abs(inwards) < ALONG * abs(down) and not any(pad.slope) and not (pad.fillet or pad.mouth_fillet)


def check_finish(finish: Finish | SeparateFinish, pad: Pad, mesh: VolumeMesh, subdivision: int) -> None:
    """Refuse a finish that is so rough that walls would touch, or so fine that it needs too many triangles.

    Parameters
    ----------
    finish : Finish or SeparateFinish
        Finish of the mould.
    pad : Pad
        The pad with the walls.
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    subdivision : int
        Subdivision of the edges of elements.

    Raises
    ------
    InputError
        naming the parameter to change.
    """
    gaps = [pad.side_height, 0.5 * pad.cell_size, pad.thinnest_wall, pad.height - pad.top_of_cell]
    if pad.rows * pad.columns > 1:
        gaps.append(pad.pitch - pad.cell_size)
    allowed = LARGEST_AMPLITUDE * min(gaps)
    for kind, walls in by_walls(finish):
        name, value, amplitude = kind.amplitude
        if amplitude > allowed:
            raise InputError(
                f"{name} = {value:g} is not allowed: walls of the cells would move by up to {amplitude:.3g} mm; at "
                f"most {allowed:.3g} mm, {name} = {allowed * value / amplitude:.3g}, is allowed for this pad."
            )
        if isinstance(kind, LayerSteps) and walls == ("side",) and kind.is_vertical and has_vertical_sides(pad):
            raise InputError(
                f"print_direction = {', '.join(f'{x:g}' for x in kind.direction)} is not allowed with layer steps on "
                "the side alone: they would change nothing, as the side of these cells is parallel to that direction; "
                "another direction, or steps on the roof too, are needed."
            )
    fine_subdivision(mesh, finish, subdivision)


def fine_subdivision(mesh: VolumeMesh, finish: Finish | SeparateFinish, least: int) -> int:
    """Number of triangles along an edge of a cell's face that resolves a finish.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    finish : Finish or SeparateFinish
        Finish of the mould.
    least : int
        Least number.

    Returns
    -------
    int
        Number of triangles, at least ``least``.

    Raises
    ------
    InputError
        if the surface would have more than `MOST_TRIANGLES`.
    """
    corners = mesh.points[mesh.faces[np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"])), :3]]
    longest = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())
    kinds = [kind for kind, _ in by_walls(finish)]
    subdivision = max(float(least), *(np.ceil(longest * kind.refinement / kind.detail[1]) for kind in kinds))
    # A plane cuts a triangle into three, and adds two along the cut.
    cuts = sum(4 * kind.cuts * longest / kind.detail[1] for kind in kinds)
    triangles = len(corners) * subdivision * (subdivision + cuts)
    if triangles > MOST_TRIANGLES:
        finest = max(kinds, key=lambda kind: kind.refinement / kind.detail[1])
        name, detail = finest.detail
        raise InputError(
            f"{name} = {detail:g} is not allowed with finish_refinement = {finest.refinement:g}: the surface would "
            f"have up to {triangles:.1e} triangles, more than {MOST_TRIANGLES:.0e}; choose a larger {name}."
        )
    return int(subdivision)
