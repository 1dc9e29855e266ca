"""Example parameters of all registered kinds of cells, laws and indenters, so that the tables test a new kind without
naming it."""

from __future__ import annotations

from itertools import cycle
from typing import Any

import numpy as np

from mitsuba_taxel.base.kinds import Kind
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.contact.indenter_shape import IndenterShape
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.cells.cell_shape import CellShape
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES, Pad
from mitsuba_taxel.parameters import REQUIRED

LENGTHS, MODULI, RATIOS = (2.0, 3.0, 1.5), (0.5, 0.3), (3.0,)
"""Example values of required parameters, which are used one after another: lengths in mm, moduli of silicones in MPa,
ratios well above 1."""
RADIUS = 1.5
"""Radius of round indenters, in mm."""


def required_values(kind: type[Kind]) -> dict[str, Any]:
    """Example values of the parameters of a kind that have no default.

    Parameters
    ----------
    kind : type
        Class of a kind of cell, law or indenter.

    Returns
    -------
    dict[str, Any]
        Values by name, in the units of the parameters.
    """
    values = {"mm": cycle(LENGTHS), "MPa": cycle(MODULI), "": cycle(RATIOS)}
    required = {name: own.unit for name, own in kind.own_parameters().items() if own.default is REQUIRED}
    return {name: next(values[unit]) for name, unit in required.items()}


def other_cells() -> list[str]:
    """Names of the registered shapes of cells that are not in the paper."""
    return [name for name in CellShape.kinds() if name not in CELL_SHAPES]


def other_indenters(listed: tuple[str, ...]) -> list[str]:
    """Names of the registered indenters, except those in ``listed`` and bodies from files."""
    return [name for name in IndenterShape.kinds() if name not in (*listed, "file")]


def pad_of(cell: str, **parameters: Any) -> Pad:
    """Make a pad with cells of any registered shape, for tests of kinds that a table does not name.

    Parameters
    ----------
    cell : str
        Name of the cell shape. A cell with a profile gets that of a hemisphere.
    **parameters : Any
        Other arguments of the pad.

    Returns
    -------
    Pad
        Pad with example values of the parameters that the shape requires.

    Raises
    ------
    InputError
        if the shape does not fit the other parameters.
    """
    if cell == "profile":
        return Pad("hemispheric", **parameters).as_profile()
    return Pad(cell, **required_values(CellShape.named(cell)), **parameters)


def cell_parameters(cell: str) -> dict[str, Any]:
    """Example values, by name, of the parameters that only cells of this shape have."""
    pad, shape = pad_of(cell), CellShape.named(cell)
    names = (*shape.uses, *shape.own_parameters())
    return {name: getattr(pad, name) for name in ("cell_height", *names)} if names else {}


def law_of(name: str) -> Material:
    """Make a material of any registered law, with example values of the parameters that it requires."""
    law: Any = Material.named(name)
    return law(**required_values(law))


def indenter_of(name: str, **parameters: Any) -> Indenter:
    """Make an indenter of any registered shape.

    Parameters
    ----------
    name : str
        Name of the shape.
    **parameters : Any
        Other arguments of the indenter.

    Returns
    -------
    Indenter
        Indenter with example values of the parameters that the shape requires.
    """
    shape = IndenterShape.named(name)
    radius = {"radius": RADIUS} if "radius" in shape.uses else {}
    return Indenter(name, **radius | required_values(shape) | parameters)


def generator(seed: int, name: str) -> np.random.Generator:
    """Random number generator for the cases of one kind. Its numbers stay the same when other kinds are registered.

    Parameters
    ----------
    seed : int
        Seed of the table.
    name : str
        Name of the kind.

    Returns
    -------
    Generator
        Generator seeded by both arguments.
    """
    return np.random.default_rng([seed, *name.encode()])
