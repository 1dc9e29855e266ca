"""Parameters of the plugin `deformable_pad`, and the Python objects (pad, material, load, finish) made from them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import MOST_HISTORY, as_numbers
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.history.timed_rows import timed_rows
from mitsuba_taxel.mechanics.materials.laws import Material, NeoHookean
from mitsuba_taxel.mechanics.materials.material_file import SUFFIX, MeasuredMaterial, read_material
from mitsuba_taxel.mechanics.materials.mullins import Mullins, mullins_of
from mitsuba_taxel.mechanics.materials.silicones import HARDNESS, SILICONES, from_shore_a, silicone
from mitsuba_taxel.mechanics.materials.viscoelastic import Terms, Viscoelastic, prony_of
from mitsuba_taxel.mechanics.surface.finish import Finish, Grooves, LayerSteps, RandomRoughness
from mitsuba_taxel.mechanics.surface.wall_finishes import SeparateFinish
from mitsuba_taxel.pads import AnyPad, Block, Pad, PadFile
from mitsuba_taxel.pads.cells import CellShape
from mitsuba_taxel.pads.markers import Markers, markers_of
from mitsuba_taxel.parameters import (
    REQUIRED,
    Kinded,
    choice,
    field_of,
    kind,
    nested,
    number,
    parameter_field,
    parameters_of,
    switch,
    text,
    transform,
    values_of,
    vector,
    whole,
)
from mitsuba_taxel.specification.region import Region
from mitsuba_taxel.specification.specification import Specification

FINISHES: dict[str, type[LayerSteps | Grooves | RandomRoughness]] = {
    "layer_steps": LayerSteps,
    "grooves": Grooves,
    "random": RandomRoughness,
}
WALL_FINISHES = ("roof_finish", "side_finish")

MOST_TRACTION = 10.0
"""Largest force per area of a patch, relative to Young's modulus: above it, elements fold however small a step is."""
NO_CELL = "none"
"""Word for a pad without cells."""
_NEO_HOOKEAN = ("material", "neo_hookean")
_LOAD = ("load",)
"""Condition of the parameters of loads; each load lists the parameters that it uses."""


def _of_pad(field: str) -> Any:
    return field_of(Pad, field, without="filename or width")


def _of_block(field: str) -> Any:
    return field_of(Block, field, when=("cell", NO_CELL))


def _of_indenter(field: str) -> Any:
    return field_of(Indenter, field, when=("indenter",))  # each indenter lists the parameters that it uses


def _of_finish(word: str, field: str) -> Any:
    return field_of(FINISHES[word], field, when=("finish", word), choosers=WALL_FINISHES)


@dataclass(frozen=True)
class DeformablePad(Specification, Kinded):
    """Silicone pad under a load: its shape, material, load, mesh and finish."""

    plugin = "deformable_pad"

    filename: str | None = text(
        None,
        "File of your own pad: a closed surface as STL, PLY or OBJ, or a solid as STEP, in mm, standing on z = 0.",
        "the name of a file",
    )
    file_scale: float | None = field_of(PadFile, "scale", needs="filename")
    file_up: str | None = field_of(PadFile, "up", needs="filename")
    regions: str | None = text(
        None,
        "A TOML file of rules that assign faces to regions.",
        "the name of a TOML file",
        needs="filename",
        default_words="flat faces at bottom and top, hollows, and the rest",
    )
    cell: str | None = kind(
        Pad.cell, CellShape, "Shape of the cells.", also={NO_CELL: "a block without cells"}, without="filename"
    )
    rows: int | None = _of_pad("rows")
    columns: int | None = _of_pad("columns")
    pitch: float | None = _of_pad("pitch")
    wall: float | None = _of_pad("wall")
    height: float | None = field_of(Pad, "height", without="filename")
    width: float | None = _of_block("width")
    depth: float | None = _of_block("depth")
    top_radius: float | None = _of_block("top_radius")
    markers: str | None = text(
        "",
        "Grid of round, dark markers on the coat, which move with the silicone: their distances along x and y and "
        "their radius, 'dx dy radius' in mm.",
        "three numbers",
        when=("cell", NO_CELL),
        default_words="none",
    )
    cell_size: float | None = _of_pad("cell_size")
    cell_height: float | None = _of_pad("cell_height")
    profile: str | None = _of_pad("profile")
    section: str | None = _of_pad("section")
    top_x: float | None = _of_pad("top_x")
    top_y: float | None = _of_pad("top_y")
    meshed_as: str | None = _of_pad("meshed_as")
    fillet: float | None = _of_pad("fillet")
    mouth_fillet: float | None = _of_pad("mouth_fillet")
    outer_fillet: float | None = _of_pad("outer_fillet")

    material: str = kind(
        "neo_hookean",
        Material,
        "A material law, a silicone of known stiffness, or a TOML file of your own, as `taxel material` writes it.",
        also=dict.fromkeys(SILICONES, ""),
        suffix=SUFFIX,
    )
    shore_a: float | None = parameter_field(HARDNESS, name="shore_a", when=_NEO_HOOKEAN)
    youngs_modulus: float | None = field_of(NeoHookean, "youngs_modulus", when=_NEO_HOOKEAN, without="shore_a")
    poisson_ratio: float | None = field_of(
        NeoHookean,
        "poisson_ratio",
        default=None,
        default_words=f"{NeoHookean.poisson_ratio:g}, or that of the silicone",
    )

    prony: str = text(
        "",
        "Viscoelasticity as a Prony series: terms 'weight time', separated by ';', such as 0.2 1; 0.1 10. The weight "
        "is the fraction of the stress that relaxes, the time its relaxation time in s. All constants of the material "
        "are instantaneous values; the long-term modulus is smaller by the factor 1 - sum of the weights.",
        default_words="none, or that of the material's file",
    )
    mullins: str = text(
        "",
        "Mullins' effect by the law of Ogden and Roxburgh: the numbers r, m in MPa and beta, such as 2 0.02 0.1. A "
        "silicone that was strained before is softer up to that strain; the earlier strains are those of `history`. "
        "All constants of the material are those of the first loading. It is not modelled together with `prony`.",
        default_words="none, or that of the material's file",
    )
    history: str = text(
        "",
        "Earlier values of the load: rows 'time x y z', or 'time pressure', separated by ';'. The load is linear "
        "between rows, and jumps where two times are equal. Studies of steps with a column time set it. It is used "
        "with viscoelasticity, Mullins' effect and friction; without viscoelasticity, only the order of the times "
        "matters.",
        default_words="none",
    )
    time: float = number(
        0.0,
        "s",
        "Time at which the load is reached, linearly from the last row of the history, or from rest at 0 s; it has no "
        "effect without `prony`.",
        minimum=0,
    )
    rate: float | None = number(
        None,
        "1/s",
        "Rate of the load, in the unit of the load per s, instead of `time`.",
        above=0,
        default_words="by the time",
    )

    load: str = kind("spread_force", Load, "Kind of load.")
    force: tuple[float, ...] | None = vector(
        (0.0, 0.0, 0.0),
        "N",
        "Total force; compression is negative along z.",
        when=_LOAD,
    )
    displacement: tuple[float, ...] | None = vector(
        (0.0, 0.0, 0.0),
        "mm",
        "Displacement of the plate, or of the indenter from the height at which its tip is level with the top of the "
        "pad.",
        when=_LOAD,
    )
    moment: tuple[float, ...] | None = vector(
        (0.0, 0.0, 0.0),
        "N mm",
        "Moment on the plate, in addition to the force.",
        when=_LOAD,
    )
    pressure: float | None = number(0.0, "MPa", "Pressure of the fluid.", when=_LOAD)
    patch_width: float | None = number(
        REQUIRED, "mm", "Side of the rectangle along x.", above=0, common=(0.02, 500), when=_LOAD
    )
    patch_depth: float | None = number(
        REQUIRED, "mm", "Side of the rectangle along y.", above=0, common=(0.02, 500), when=_LOAD
    )
    patch_x: float | None = number(0.0, "mm", "Centre of the rectangle along x.", when=_LOAD)
    patch_y: float | None = number(0.0, "mm", "Centre of the rectangle along y.", when=_LOAD)
    indenter: str | None = field_of(Indenter, "shape", when=_LOAD)
    indenter_radius: float | None = _of_indenter("radius")
    indenter_edge_radius: float | None = _of_indenter("edge_radius")
    indenter_angle: float | None = _of_indenter("angle")
    indenter_tilt: float | None = _of_indenter("tilt")
    indenter_file: str | None = _of_indenter("file")
    indenter_file_scale: float | None = _of_indenter("file_scale")
    indenter_file_up: str | None = _of_indenter("file_up")
    indenter_x: float | None = number(0.0, "mm", "Position of the indenter's tip along x.", when=_LOAD)
    indenter_y: float | None = number(0.0, "mm", "Position of the indenter's tip along y.", when=_LOAD)
    friction: float | None = field_of(Indenter, "friction", when=_LOAD)
    self_contact: bool = switch(
        False,
        "Whether the load continues after the pad touches itself, the board or a photo_reflector, with contact without "
        "friction between them; otherwise the load ends there. Needs the Python package ipctk.",
    )

    mesh_size: float | None = number(
        None,
        "mm",
        "Size of the finite elements.",
        above=0,
        common=(0.02, 100),
        without="mesh_tolerance",
        default_words="1.25 for cells and walls like the default; proportional to the scale of the pad, and to the "
        "square root of its thinnest wall; for loaded domes 0.5 or 0.6 times that, with at most 16 cells and without "
        "an indenter or memory",
    )
    mesh_tolerance: float | None = number(
        None,
        "",
        "Relative error of the roofs' displacement under a small load; it determines the size, instead of `mesh_size`.",
        above=0,
        maximum=1,
    )
    read_cells: str = text(
        "all", "Numbers of the cells that are read, such as 1, 5, or all; only their surface is finely triangulated."
    )
    subdivision: int = whole(
        6,
        1,
        64,
        "Triangles along the longest edge of a finite element on the surface of a cell; shorter edges have fewer "
        "triangles of the same size. Curved mirrors need 3 or more.",
    )

    finish: str = choice("smooth", ("smooth", *FINISHES), "Texture left by the mould on roof and side of the cells.")
    roof_finish: str | None = choice(
        None,
        ("smooth", *FINISHES),
        "Texture of the roof, if it differs from `finish`. A kind has the same parameters on both walls.",
        default_words="as finish",
    )
    side_finish: str | None = choice(
        None, ("smooth", *FINISHES), "Texture of the side, if it differs from `finish`.", default_words="as finish"
    )
    layer_height: float | None = _of_finish("layer_steps", "layer_height")
    print_direction: tuple[float, ...] | None = _of_finish("layer_steps", "direction")
    layer_offset: float | None = _of_finish("layer_steps", "offset")
    groove_pitch: float | None = _of_finish("grooves", "pitch")
    groove_depth: float | None = _of_finish("grooves", "depth")
    groove_direction: tuple[float, ...] | None = _of_finish("grooves", "direction")
    rms_height: float | None = _of_finish("random", "rms_height")
    correlation_length: float | None = _of_finish("random", "correlation_length")
    roughness_seed: int | None = _of_finish("random", "seed")
    finish_refinement: float | None = field_of(
        LayerSteps,
        "refinement",
        when=("finish", *FINISHES),
        choosers=WALL_FINISHES,
        default=None,
        default_words=f"{LayerSteps.refinement:g}; random {RandomRoughness.refinement:g}",
    )
    to_world: Any = transform("Rigid motion, with at most a uniform scale, applied to the deformed pad.")
    bsdf: Region | None = nested(
        "bsdf", Region, None, "BSDF of the pad, usually a `region`.", default_words="absorbing"
    )

    @classmethod
    def read(cls, props: Any) -> DeformablePad:
        """Create the parameters of a pad from a scene's element; a material's file is relative to the scene file."""
        from mitsuba_taxel.backend.plugin_objects import find_file

        find_file(props, "material", SUFFIX)
        return super().read(props)

    def _check(self) -> None:
        for name in ("finish", *WALL_FINISHES):
            if getattr(self, name) in ("smooth", None):
                continue
            if self.filename is not None:
                raise InputError(
                    f"filename is not allowed with {name} = {getattr(self, name)!r}: a finish needs a pad of this "
                    "package's cells, without filename."
                )
            if self.cell == NO_CELL:
                raise InputError(
                    f"cell = {NO_CELL!r} is not allowed with {name} = {getattr(self, name)!r}: a finish needs cells."
                )
        if self.finish != "smooth" and self.roof_finish is not None and self.side_finish is not None:
            raise InputError(
                f"finish = {self.finish!r} is not allowed with both roof_finish and side_finish, which leave no wall "
                "for it; take one out."
            )
        if self.cell == NO_CELL and self.read_cells != "all":
            raise InputError(
                f"read_cells = {self.read_cells!r} is not allowed for cell = {NO_CELL!r}: it has no cells; take it out."
            )
        self.build_finish()
        self.cell_numbers()
        self.build_markers()
        terms, (times, values), mullins = self.build_prony(), self.build_history(), self.build_mullins()
        if terms and mullins:
            given = "" if self.mullins.strip() else f" (of {self.material})"
            raise InputError(
                f"mullins = {' '.join(f'{c:g}' for c in mullins.constants)!r}{given} is not allowed with "
                "viscoelasticity, prony: only one of both is modelled."
            )
        if self.rate is not None and self.time:
            raise InputError(f"time = {self.time:g} and rate = {self.rate:g} exclude each other: leave one out.")

        # Histories, and loads that would fold elements. Files of indenters are only known where the scene is.
        if terms and self.indenter_file is None:
            timed_rows(Viscoelastic(self.build_material(), terms), self.build_load()[0], np.array(values), times)
        material = self.build_material()
        if self.indenter_file is None:
            load, value = self.build_load()
            if load.area is not None:
                traction = max(map(math.hypot, *zip(*values, strict=True))) / load.area
                if traction > MOST_TRACTION * material.youngs_modulus:
                    raise InputError(
                        f"a traction of {traction:.3g} MPa on {load.where} is not allowed: at most "
                        f"{MOST_TRACTION:g} times Young's modulus, {material.youngs_modulus:g} MPa, is needed."
                    )
            if not terms:
                timed_rows(mullins or material, load, np.array(values), None)
            load.check(value)
        if self.filename is None:
            self.build_pad()

    def build_pad(self, find: Any = Path) -> AnyPad:
        """The undeformed pad; ``find`` converts names of files into paths."""
        if self.filename is None:
            return Block(**self._own(Block)) if self.cell == NO_CELL else Pad(**self._own(Pad))
        rules = () if self.regions is None else find(self.regions)
        return PadFile(find(self.filename), rules, **self._own(PadFile))

    def build_markers(self) -> Markers | None:
        """The markers on the coat of a block; None without markers."""
        return markers_of(self.markers, Block(**self._own(Block))) if self.markers else None

    def build_material(self) -> Material:
        """Create the material law of the pad."""
        ratio = {} if self.poisson_ratio is None else {"poisson_ratio": self.poisson_ratio}
        if self.material in SILICONES:
            return silicone(self.material).changed(**ratio)
        if measured := self._measured:
            return measured.law.changed(**ratio)
        if self.shore_a is not None:
            return from_shore_a(self.shore_a, **ratio)
        law = Material.named(self.material)
        constants = {name: getattr(self, name) for name in law.own_parameters()} | ratio
        return law(**{name: value for name, value in constants.items() if value is not None})

    def build_prony(self) -> Terms:
        """Terms of the Prony series, of the scene or of the material's file."""
        measured = None if self.prony else self._measured
        return measured.prony if measured else prony_of(self.prony)

    def build_mullins(self) -> Mullins | None:
        """The material with Mullins' effect, of the scene or of the material's file; None without the effect."""
        law = self.build_material()
        if self.mullins.strip():
            return mullins_of(self.mullins, law)
        measured = self._measured
        return replace(measured.mullins, law=law) if measured and measured.mullins else None

    @property
    def tested_stretch(self) -> float | None:
        """Largest principal stretch of the tests of the material; None if unknown."""
        if self.material in SILICONES:
            strain = SILICONES[self.material].max_strain
            return None if strain is None else 1 + strain
        measured = self._measured
        return measured.largest_stretch if measured else None

    @property
    def _measured(self) -> MeasuredMaterial | None:
        """Content of the material's file; None if the material is not from a file."""
        return read_material(self.material) if self.material.endswith(SUFFIX) else None

    def build_load(self, find: Any = Path) -> tuple[Load, tuple[float, ...]]:
        """Create the load and its value; ``find`` converts the name of a file into its path."""
        return Load.named(self.load).of_scene(self, find, self_contact=self.self_contact), self.load_value

    @property
    def load_value(self) -> tuple[float, ...]:
        """Components of the load: force in N, displacement in mm, pressure in MPa, or force and moment in N mm."""
        values = [getattr(self, name) for name in Load.named(self.load).quantities()]
        return tuple(chain.from_iterable(value if isinstance(value, tuple) else (value,) for value in values))

    def build_history(self) -> tuple[list[float], list[tuple[float, ...]]]:
        """Times in s and values of the load, the current value last; raises `InputError`."""
        value = self.load_value
        rows: list[list[float]] = []
        if self.history.count(";") >= MOST_HISTORY:
            count = self.history.count(";") + 1
            raise InputError(f"history with {count} rows is not allowed: at most {MOST_HISTORY} are possible.")
        for row in filter(None, (words.split() for words in self.history.split(";"))):
            numbers = as_numbers(row)
            if numbers is None or len(numbers) != 1 + len(value):
                needed = {1: "pressure", 3: "x y z", 6: "fx fy fz mx my mz"}[len(value)]
                words = f"history row {' '.join(row)!r} is not allowed: finite numbers"
                raise InputError(f"{words} 'time {needed}' are needed.")
            # A first row of rest has no effect.
            if rows or any(numbers):
                rows.append(numbers)

        # The time of the current value, given or by the rate of the load.
        times, values = [row[0] for row in rows], [tuple(row[1:]) for row in rows]
        time = self.time
        if self.rate is not None:
            change = np.array(value) - (np.array(values[-1]) if values else 0.0)
            time = (times[-1] if times else 0.0) + float(np.linalg.norm(change)) / self.rate
        return [*times, time], [*values, value]

    def build_indenter(self, find: Any = Path) -> Indenter:
        """The indenter; ``find`` converts the name of a file into its path."""
        position: Any = (self.indenter_x, self.indenter_y)
        arguments = self._own(Indenter)
        if self.indenter_file is not None:
            arguments["file"] = str(find(self.indenter_file))
        return Indenter(at=position, **arguments)

    def build_finish(self) -> Finish | SeparateFinish | None:
        """Create the finish of the cells' walls; None if both walls are smooth."""
        roof, side = (wall or self.finish for wall in (self.roof_finish, self.side_finish))
        kinds = {word: FINISHES[word](**self._own(FINISHES[word])) for word in {roof, side} - {"smooth"}}
        if roof == side:
            return kinds.get(roof)
        return SeparateFinish(kinds.get(roof), kinds.get(side))

    def cell_numbers(self) -> tuple[int, ...] | None:
        """Numbers of the cells that are read; None for all."""
        words = self.read_cells.replace(",", " ").split()
        if words == ["all"]:
            return None
        if not words or not all(word.isdecimal() and int(word) > 0 for word in words):
            raise InputError(
                f"read_cells = {' '.join(words)!r} is not allowed: 'all' or numbers of cells such as '1, 5' are needed."
            )
        return tuple(sorted({int(word) for word in words}))

    def _own(self, cls: type) -> dict[str, Any]:
        """Arguments with which a pad, an indenter or a finish is constructed: the values of its parameters that are not
        None."""
        values = {field: getattr(self, parameter.name) for field, parameter in parameters_of(cls).items()}
        return {field: value for field, value in values.items() if value is not None}

    @classmethod
    def of(
        cls,
        pad: Pad,
        material: Material | Viscoelastic | Mullins,
        load: Load,
        value: Any,
        finish: Finish | SeparateFinish | None,
        **settings: Any,
    ) -> DeformablePad:
        """Create the plugin's parameters from Python objects: a pad, a material, a load and a finish.

        Parameters
        ----------
        pad : Pad
            The undeformed pad.
        material : Material or Viscoelastic or Mullins
            Material of the pad.
        load : Load
            The load.
        value : sequence of float
            Components of the load.
        finish : Finish or SeparateFinish or None
            Finish of the cells.
        **settings : Any
            Other parameters, by name.

        Raises
        ------
        InputError
            if a scene cannot contain the material or the load because it has no name; if ``value`` does not suit the
            load; or if the finishes of roof and side have refinements that a scene cannot contain.
        """
        if isinstance(material, Viscoelastic):
            settings["prony"] = "; ".join(f"{weight!r} {time!r}" for weight, time in material.prony)
            material = material.law
        elif isinstance(material, Mullins):
            settings["mullins"] = " ".join(repr(float(constant)) for constant in material.constants)
            material = material.law
        if not material.name:
            law = type(material).__name__
            raise InputError(
                f"material = {material!r} is not allowed in a scene: its law needs a name, as in "
                f'class {law}(Material, name="{law.lower()}").'
            )
        if len(value) != load.components:
            raise InputError(f"force = {tuple(value)} is not allowed: {load.components} numbers are needed for {load}.")
        if not load.name:
            name = type(load).__name__
            raise InputError(
                f"load = {load!r} is not allowed in a scene: it needs a name, as in "
                f'class {name}(DeadForce, name="{name.lower()}").'
            )
        parts = value[:1] if load.components == 1 else (value[3 * k : 3 * k + 3] for k in range(load.components // 3))
        values: dict[str, Any] = {**dict(zip(load.quantities(), parts, strict=True)), **settings}
        values.update(self_contact=load.self_contact, load=load.name, **load.scene_values())
        values.update(_finish_values(finish))
        values.update(material=material.name)
        constants = {name: getattr(material, name) for name in material.parameters}
        return cls(**values_of(pad), **constants, **values)


def _finish_values(finish: Finish | SeparateFinish | None) -> dict[str, Any]:
    """Parameters of a finish, by their names in a scene."""
    if finish is None:
        return {}
    words: dict[Any, str] = {kind: word for word, kind in FINISHES.items()}
    if not isinstance(finish, SeparateFinish):
        return {"finish": words[type(finish)], **values_of(finish)}
    walls = {name: wall for name, wall in (("roof", finish.roof), ("side", finish.side)) if wall is not None}
    values: dict[str, Any] = {}
    for name, wall in walls.items():
        values.update({f"{name}_finish": words[type(wall)], **values_of(wall)})
    # A scene has a single finish_refinement; without it, each kind has its default.
    refinements = {wall.refinement for wall in walls.values()}
    if all(wall.refinement == type(wall).refinement for wall in walls.values()):
        del values["finish_refinement"]
    elif len(refinements) > 1:
        raise InputError(
            f"finish_refinement = {' and '.join(f'{wall.refinement:g} for {name}' for name, wall in walls.items())} is "
            "not allowed: the same number for both is needed, or the default of each."
        )
    return values
