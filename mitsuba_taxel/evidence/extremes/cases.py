"""List of the extreme cases of the mechanics, each with its pad, material and load."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from mitsuba_taxel.evidence.extremes.case import MESH_SIZE, NORMAL, ExtremeCase
from mitsuba_taxel.evidence.extremes.slivers import SliverPad
from mitsuba_taxel.evidence.rows.kind_examples import indenter_of, law_of, other_cells, other_indenters, pad_of
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.elements.loads import (
    IndenterDisplacement,
    IndenterForce,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    PlateWrench,
    Pressure,
    SpreadForce,
)
from mitsuba_taxel.mechanics.materials.laws import Material, MooneyRivlin, NeoHookean
from mitsuba_taxel.mechanics.materials.silicones import silicone
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES, DEFAULT_MESH_SIZE, Pad

_PAD = Pad()
CELL = replace(_PAD, rows=1, columns=1)
"""The pad of one cell into which bodies are pressed."""
_E = NeoHookean().youngs_modulus
_TANGENTIAL = (20.0, 0.0, -8.0)
LAWS = ("neo_hookean", "mooney_rivlin", "yeoh")
INDENTERS = ("sphere", "punch", "cylinder", "plane")
"""Laws and indenters whose extremes are listed below, one by one."""


def stability_cases() -> list[ExtremeCase]:
    """All extreme cases of the mechanics, in the order of the table."""
    materials = (_poisson_ratios, _stiffnesses, _laws)
    pads = (_walls, _sizes, _arrays)
    loads = (_loads, _indenters, _large_forces, _self_contacts, _one_step)
    meshes = (_default_meshes, _meshes)
    return [case for group in (*materials, *pads, *loads, *meshes, _other_kinds) for case in group()]


def _poisson_ratios() -> Iterator[ExtremeCase]:
    for nu in (0.3, 0.45, 0.49, 0.499, 0.4999, 0.49999, 0.5):
        yield ExtremeCase(
            f"nu = {nu:g}, -20 N", material=NeoHookean(poisson_ratio=nu), with_finer_mesh=nu in (0.3, 0.49, 0.5)
        )
    for nu in (0.3, 0.5):
        yield ExtremeCase(
            f"nu = {nu:g}, 20 N along x at -8 N",
            material=NeoHookean(poisson_ratio=nu),
            value=_TANGENTIAL,
            with_finer_mesh=nu == 0.5,
        )


def _walls() -> Iterator[ExtremeCase]:
    for wall in (1.0, 0.3, 0.1, 0.05):
        pad = replace(_PAD, wall=wall, pitch=_PAD.cell_size + wall)
        yield ExtremeCase(f"walls of {wall:g} mm, -20 N", pad)
    thin = replace(_PAD, wall=0.3, pitch=_PAD.cell_size + 0.3)
    for size in (1.25, 0.8, 0.63):  # the walls buckle
        yield ExtremeCase(f"walls of 0.3 mm, mesh of {size:g} mm, -20 N", thin, mesh_size=size)
    pair, plate = replace(thin, rows=1, columns=2), PlateForce(self_contact=True)
    yield ExtremeCase("1 x 2 cells, walls of 0.3 mm, -20 N by a plate with self_contact", pair, load=plate)


def _stiffnesses() -> Iterator[ExtremeCase]:
    for modulus in (0.05, 0.5, 50.0, 1000.0):
        force = -20 * modulus / _E
        yield ExtremeCase(f"E = {modulus:g} MPa, {force:.4g} N", material=NeoHookean(modulus), value=(0.0, 0.0, force))
        yield ExtremeCase(f"E = {modulus:g} MPa, -20 N", material=NeoHookean(modulus))


def _laws() -> Iterator[ExtremeCase]:
    mu = NeoHookean().shear_modulus
    yield ExtremeCase("Mooney-Rivlin, c10 = c01, -20 N", material=MooneyRivlin(mu / 4, mu / 4))
    yield ExtremeCase("Yeoh (dragon_skin_20), -2 N", material=silicone("dragon_skin_20"), value=(0.0, 0.0, -2.0))


def _loads() -> Iterator[ExtremeCase]:
    yield ExtremeCase("rigid plate bonded on top, -20 N", load=PlateForce(), with_finer_mesh=True)
    yield ExtremeCase("rigid plate bonded on top, 20 N along x at -8 N", load=PlateForce(), value=_TANGENTIAL)
    yield ExtremeCase(
        "plate moved by 30 % of the height", load=PlateDisplacement(), value=(0.0, 0.0, -0.3 * _PAD.height)
    )
    yield ExtremeCase(
        "tilting plate, -8 N and 60 N mm", load=PlateWrench(), value=(0.0, 0.0, -8.0, 0.0, 60.0, 0.0)
    )
    yield ExtremeCase(
        "patch of 3 mm x 3 mm off the centre, -8 N", load=PatchForce((2.0, 1.0), (3.0, 3.0)), value=(0, 0, -8.0)
    )
    yield ExtremeCase("pressure of 1 MPa", load=Pressure(), value=(1.0,))
    yield ExtremeCase("pulled, 20 N", value=(0.0, 0.0, 20.0))


def _indenters() -> Iterator[ExtremeCase]:
    """Bodies of extreme size, position and depth on one cell, 4.55 mm wide and high, with walls of 1 mm."""
    # Prescribed displacements.
    side, full_depth = CELL.extent[0] / 2, 0.9 * CELL.height
    ball, edge = Indenter("sphere", radius=2.5), CELL.cell_size / 2
    bodies = {
        "a ball of 2.5 mm, off the centre": (replace(ball, at=(0.8, 0.4)), (0, 0, -0.5)),
        "a ball of 2.5 mm, 90 % of the height": (ball, (0, 0, -full_depth)),
        "a ball of 2.5 mm on the edge": (replace(ball, at=(side, 0.3)), (0, 0, -0.5)),
        "a ball of 2.5 mm on the corner": (replace(ball, at=(side, side)), (0, 0, -0.5)),
        "a ball of 2.5 mm beside the pad": (replace(ball, at=(side + 2.0, 0.0)), (0, 0, -2.0)),
        "a ball of 2.5 mm that misses the pad": (replace(ball, at=(50.0, 0.0)), (0, 0, -0.5)),
        "a ball of 2.5 mm, moved across the edge of a cell": (replace(ball, at=(edge, 0.0)), (0.5, 0, -0.3)),
        "a ball of 2.5 mm, moved against the side": (replace(ball, at=(side + 2.6, 0.0)), (-0.5, 0, -2.0)),
        "a ball of 0.05 mm": (Indenter("sphere", radius=0.05), (0, 0, -0.05)),
        "a ball of 500 mm": (Indenter("sphere", radius=500.0), (0, 0, -0.2)),
        "a punch of 1.5 mm": (Indenter("punch", radius=1.5), (0, 0, -0.3)),
        "a punch of 1.5 mm on the edge": (Indenter("punch", radius=1.5, at=(side, 0.0)), (0, 0, -0.3)),
        "a punch of 1.5 mm that misses the pad": (Indenter("punch", radius=1.5, at=(50.0, 0.0)), (0, 0, -0.3)),
        "a punch of 1.5 mm, 90 % of the height": (Indenter("punch", radius=1.5), (0, 0, -full_depth)),
        "a punch of 1.5 mm, tilted by 30 degrees": (Indenter("punch", radius=1.5, tilt=30.0), (0, 0, -0.5)),
        "a punch of 1.5 mm, tilted by 80 degrees": (Indenter("punch", radius=1.5, tilt=80.0), (0, 0, -0.5)),
        "a punch of 0.05 mm": (Indenter("punch", radius=0.05), (0, 0, -0.03)),
        "a sharp punch of 1 mm, edge of 0.001 mm": (Indenter("punch", radius=1.0, edge_radius=1e-3), (0, 0, -0.1)),
        "a rod of 1 mm, at 30 degrees": (Indenter("cylinder", radius=1.0, angle=30.0), (0, 0, -0.3)),
        "a rod of 1 mm along the edge": (Indenter("cylinder", radius=1.0, angle=90.0, at=(side, 0.0)), (0, 0, -0.3)),
        "a rod of 1 mm, 90 % of the height": (Indenter("cylinder", radius=1.0), (0, 0, -full_depth)),
        "a rod of 1 mm that misses the pad": (Indenter("cylinder", radius=1.0, at=(0.0, 50.0)), (0, 0, -0.3)),
        "a rod of 0.05 mm": (Indenter("cylinder", radius=0.05), (0, 0, -0.05)),
        "a plate, 90 % of the height": (Indenter("plane"), (0, 0, -full_depth)),
        "a plate, tilted by 10 degrees": (Indenter("plane", tilt=10.0), (0, 0, -0.5)),
        "a plate, tilted by 80 degrees": (Indenter("plane", tilt=80.0), (0, 0, -0.5)),
    }
    for name, body in (
        ("a ball of 2.5 mm", ball),
        ("a punch of 1 mm", Indenter("punch", radius=1.0)),
        ("a rod of 1 mm", Indenter("cylinder", radius=1.0, angle=90.0)),
        ("a plate", Indenter("plane")),
    ):
        bodies[f"{name}, dragged with a friction of 2"] = (replace(body, friction=2.0), (0.3, 0, -0.3))
    for name, (body, value) in bodies.items():
        yield ExtremeCase(f"pressed by {name}", CELL, load=IndenterDisplacement(body), value=value)
    for name, body, value in (
        ("a ball of 2.5 mm, 60 % of the height", ball, (0, 0, -0.6 * CELL.height)),
        ("a ball of 2.5 mm, dragged with a friction of 2", replace(ball, friction=2.0), (0.3, 0, -0.4 * CELL.height)),
    ):
        load = IndenterDisplacement(body, self_contact=True)
        yield ExtremeCase(f"pressed by {name}, with self_contact", CELL, load=load, value=value)
    # Prescribed forces.
    for force in (1e-9, 2.0, 2000.0):
        yield ExtremeCase(f"pressed by {force:g} N on a ball", CELL, load=IndenterForce(ball), value=(0, 0, -force))
    sliding = IndenterForce(replace(ball, friction=0.3), self_contact=True)
    yield ExtremeCase("pressed by 20 N on a ball, friction of 0.3, with self_contact", CELL, load=sliding)
    stuck = IndenterForce(replace(ball, friction=2.0))
    yield ExtremeCase(
        "pressed by 2 N on a ball, dragged by 1 N with a friction of 2", CELL, load=stuck, value=(1.0, 0, -2.0)
    )
    missed = IndenterForce(replace(ball, at=(50.0, 0.0)))
    yield ExtremeCase(
        "pressed by 2 N on a ball that misses the pad", CELL, load=missed, value=(0, 0, -2.0), refused=True
    )


def _large_forces() -> Iterator[ExtremeCase]:
    for shape in CELL_SHAPES:
        yield ExtremeCase(f"{shape}, -200 N", Pad(shape), value=(0.0, 0.0, -200.0))
    for shape in CELL_SHAPES:
        for name, x, y in (("x", 40.0, 0.0), ("the diagonal", 40 * math.sqrt(0.5), 40 * math.sqrt(0.5))):
            yield ExtremeCase(
                f"{shape}, 40 N along {name} at -8 N", Pad(shape), value=(x, y, -8.0), with_finer_mesh=False
            )


def _self_contacts() -> Iterator[ExtremeCase]:
    """Loads beyond the first self-contact. Neither the end of the load path nor its reason may depend on the mesh."""
    spread, plate = SpreadForce(self_contact=True), PlateForce(self_contact=True)
    for words, value, load, shapes in (
        ("-200 N", (0.0, 0.0, -200.0), spread, CELL_SHAPES),
        ("-200 N by a plate", (0.0, 0.0, -200.0), plate, CELL_SHAPES),
        ("40 N along x at -8 N", (40.0, 0.0, -8.0), spread, CELL_SHAPES),
        ("40 N along x at -8 N by a plate", (40.0, 0.0, -8.0), plate, CELL_SHAPES),
    ):
        for shape in shapes:
            for size in (MESH_SIZE, DEFAULT_MESH_SIZE):
                name = f"{words} on {shape} cells with self_contact, mesh of {size:g} mm"
                yield ExtremeCase(name, Pad(shape), load=load, value=value, mesh_size=size)
    for shape in CELL_SHAPES:
        for size in (DEFAULT_MESH_SIZE, DEFAULT_MESH_SIZE / 2):
            name = f"-30 N on one {shape} cell with self_contact, mesh of {size:g} mm"
            yield ExtremeCase(name, Pad(shape, rows=1, columns=1), load=spread, value=(0.0, 0.0, -30.0), mesh_size=size)


def _other_kinds() -> Iterator[ExtremeCase]:
    """Cases for all registered cells, laws and indenters that no other case contains, so that a new kind is tested
    without being named here."""
    # Cells.
    for cell in other_cells():
        pad = pad_of(cell)
        yield ExtremeCase(f"{cell}, -200 N", pad, value=(0.0, 0.0, -200.0))
        yield ExtremeCase(f"{cell}, 20 N along x at -8 N", pad, value=_TANGENTIAL)
        single, load = pad_of(cell, rows=1, columns=1), SpreadForce(self_contact=True)
        name = f"-30 N on one {cell} cell with self_contact, mesh of {DEFAULT_MESH_SIZE:g} mm"
        yield ExtremeCase(name, single, load=load, value=(0.0, 0.0, -30.0), mesh_size=DEFAULT_MESH_SIZE)
    # Laws.
    for name in Material.kinds():
        if name not in LAWS:
            yield ExtremeCase(f"{name}, -2 N", material=law_of(name), value=(0.0, 0.0, -2.0))
    # Indenters.
    for name in other_indenters(INDENTERS):
        body = indenter_of(name)
        for words, changed, value in (
            ("0.3 mm deep", body, (0, 0, -0.3)),
            ("90 % of the height", body, (0, 0, -0.9 * CELL.height)),
            ("dragged with a friction of 2", replace(body, friction=2.0), (0.3, 0, -0.3)),
            ("beside the pad", replace(body, at=(50.0, 0.0)), (0, 0, -0.3)),
        ):
            yield ExtremeCase(f"pressed by {name}, {words}", CELL, load=IndenterDisplacement(changed), value=value)


def _one_step() -> Iterator[ExtremeCase]:
    yield ExtremeCase("one step to -20 N", in_one_step=True)
    yield ExtremeCase("one step to 20 N along x and -8 N", value=_TANGENTIAL, in_one_step=True)


def _meshes() -> Iterator[ExtremeCase]:
    for name, value in (("-20 N", NORMAL), ("20 N along x at -8 N", _TANGENTIAL)):
        yield ExtremeCase(f"slivers, {name}", SliverPad(), value=value)
        for size in (4.0, 2.0, 1.2):
            yield ExtremeCase(f"mesh of {size:g} mm, {name}", value=value, mesh_size=size, with_finer_mesh=size > 1.2)


def _default_meshes() -> Iterator[ExtremeCase]:
    for shape in CELL_SHAPES:
        for size in (DEFAULT_MESH_SIZE, DEFAULT_MESH_SIZE / 2):  # the end must not depend on it
            yield ExtremeCase(
                f"{shape}, mesh of {size:g} mm, -200 N", Pad(shape), value=(0.0, 0.0, -200.0), mesh_size=size
            )
    for shape in CELL_SHAPES:
        yield ExtremeCase(
            f"{shape}, default mesh, -20 N", Pad(shape), mesh_size=DEFAULT_MESH_SIZE, with_finer_mesh=True
        )


def _sizes() -> Iterator[ExtremeCase]:
    for extent, name in ((1.0, "1 mm"), (1000.0, "1 m")):
        scale = extent / _PAD.extent[0]
        lengths = ("pitch", "wall", "height", "cell_size", "cell_height")
        pad = replace(_PAD, **{length: scale * getattr(_PAD, length) for length in lengths})
        for value, words in ((NORMAL, "-20 N"), (_TANGENTIAL, "20 N along x at -8 N")):
            yield ExtremeCase(
                f"pad of {name}, {words}, to scale",
                pad,
                value=tuple(scale**2 * force for force in value),
                mesh_size=MESH_SIZE * scale,
            )


def _arrays() -> Iterator[ExtremeCase]:
    for side in (1, 3, 6, 12):
        force = -8 * side**2 / 9
        yield ExtremeCase(
            f"{side} x {side} cells, {force:.4g} N",
            replace(_PAD, rows=side, columns=side),
            value=(0.0, 0.0, force),
            with_finer_mesh=side == 1,
        )
    yield ExtremeCase(
        "1 x 1 cells, mesh of 3 mm, -1 N", CELL, value=(0.0, 0.0, -1.0), mesh_size=3.0, with_finer_mesh=True
    )
