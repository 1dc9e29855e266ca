"""A pad from a file, and its second-order tetrahedral mesh."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import cached_property
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING

from mitsuba_taxel.base.arguments import path_of, require
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.files.text import read_bytes
from mitsuba_taxel.base.processes.activities import activity
from mitsuba_taxel.pads.imported.placement import AS_DRAWN, DIRECTIONS, Placement
from mitsuba_taxel.pads.imported.rules import Rule, read_rules
from mitsuba_taxel.parameters import choice, number
from mitsuba_taxel.parameters.checked import check

if TYPE_CHECKING:
    from mitsuba_taxel.geometry.volume_mesh import VolumeMesh

SURFACE_FORMATS = (".stl", ".ply", ".obj")
STEP_FORMATS = (".step", ".stp")
MOST_BYTES = 100 * 2**20


def _version(package: str) -> str:
    """Version of a package, which need not be installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


@dataclass(frozen=True)
class PadFile(Displayed):
    """A pad in a file: a closed surface of triangles (STL, PLY, OBJ) or a solid (STEP), standing on z = 0.

    Pads with the same content and the same rules are equal, wherever the file lies.

    Parameters
    ----------
    path : Path
        The file; its extension determines the format.
    regions : tuple[Rule, ...]
        Rules that assign regions to faces, or a TOML file of them (see :func:`read_rules`); the first matching rule
        applies. The regions of other faces follow from their shape: see
        :func:`mitsuba_taxel.pads.imported.regions.tagged`.
    scale : float
        Length of the file's unit in mm; STEP files state their unit, and are in mm as they are read.
    up : str
        Direction in the file that points up, ``x``, ``y``, ``z``, ``-x``, ``-y`` or ``-z``: the pad is turned, the
        middle of the box around it moved to x = y = 0, and its lowest point to z = 0. ``as drawn`` leaves the pad where
        it is.

    Raises
    ------
    InputError
        If the file cannot be read, is too large or of another format, or a rule is not allowed.
    """

    path: Path = field(compare=False)
    regions: tuple[Rule, ...] = ()
    scale: float = number(
        1.0,
        "",
        "Length of the file's unit in mm: 25.4 for inches, 1000 for m. The unit that a STEP file states is applied "
        "automatically.",
        above=0,
        name="file_scale",
    )
    up: str = choice(
        AS_DRAWN,
        DIRECTIONS,
        "Direction in the file that points up. With one, the box around the pad is centred at x = y = 0, and stands on "
        "z = 0.",
        name="file_up",
    )
    suffix: str = field(init=False, repr=False)
    """Ending of the file's name, in small letters."""
    digest: str = field(init=False, repr=False)
    """SHA-256 of the file's content when this object was made."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", path_of("path", self.path))
        object.__setattr__(self, "suffix", self.path.suffix.lower())
        if self.suffix not in SURFACE_FORMATS + STEP_FORMATS:
            formats = ", ".join(SURFACE_FORMATS + STEP_FORMATS)
            raise InputError(f"filename = {self.path} is not allowed: a file that ends in one of {formats} is needed.")
        check(self)
        require("regions", self.regions, (str, Path, Sequence), "rules or the name of a TOML file")
        rules = read_rules(self.regions) if isinstance(self.regions, str | Path) else tuple(self.regions)
        if not all(isinstance(rule, Rule) for rule in rules):
            raise InputError(f"regions = {self.regions!r} is not allowed: rules or the name of a TOML file are needed.")
        object.__setattr__(self, "regions", rules)
        object.__setattr__(self, "digest", hashlib.sha256(self._read()).hexdigest())

    def _read(self) -> bytes:
        try:
            return read_bytes(self.path, MOST_BYTES)
        except OSError as error:
            raise InputError(f"filename = {self.path} cannot be read ({error.strerror or error}).") from error

    @property
    def is_drawn(self) -> bool:
        """Whether the file contains curved faces, as a CAD drawing does, rather than triangles."""
        return self.suffix in STEP_FORMATS

    @property
    def identity(self) -> list[object]:
        """Values that identify the pad, fit for JSON."""
        meshers = ["netgen-mesher", *([] if self.is_drawn else ["pytetwild"])]
        installed = [[mesher, _version(mesher)] for mesher in meshers]
        rules = [asdict(rule) for rule in self.regions]
        return [self.suffix, self.digest, rules, self.scale, self.up, installed]

    @property
    def placement(self) -> Placement:
        """Transformation (scale and upward direction) from the coordinates of the file to those of the pad."""
        return Placement(self.scale, self.up)

    @cached_property
    def default_mesh_size(self) -> float:
        """Default size of the finite elements in mm, by the rule of the built-in pads.

        Raises `InputError` if the file holds no pad.
        """
        return default_size_of(self)

    def mesh(self, mesh_size: float) -> VolumeMesh:
        """Volume mesh of the pad; see `mesh_pad_file`.

        Parameters
        ----------
        mesh_size : float
            Length of the edges of elements, mm.

        Returns
        -------
        VolumeMesh
            Undeformed quadratic tetrahedra with tagged faces.

        Raises
        ------
        InputError
            if the size is not allowed, or the file is not a pad.
        ComputationError
            if the mesher fails.
        """
        return mesh_pad_file(self, mesh_size)

    def content(self) -> bytes:
        """The content of the file.

        Returns
        -------
        bytes
            Content of the file when this object was created.

        Raises
        ------
        InputError
            if the file cannot be read, or has changed since this object was created.
        """
        content = self._read()
        if hashlib.sha256(content).hexdigest() != self.digest:
            raise InputError(f"filename = {self.path} is not allowed: it has changed since it was opened.")
        return content


def mesh_pad_file(pad: PadFile, mesh_size: float) -> VolumeMesh:
    """Mesh a pad from a file with elements of about ``mesh_size`` mm.

    Parameters
    ----------
    pad : PadFile
        The file, with its rules, scale and direction.
    mesh_size : float
        Length of the edges of elements, mm.

    Returns
    -------
    VolumeMesh
        Undeformed quadratic tetrahedra with tagged faces.

    Raises
    ------
    InputError
        if ``mesh_size`` is not a finite length above 0, or needs more elements than fit in memory, or the file contains
        no pad that can be meshed; the message gives the position of an error of the surface.
    ComputationError
        if meshing fails, or leaves an inverted element that cannot be repaired.
    """
    from mitsuba_taxel.geometry.element_maps import worst_element
    from mitsuba_taxel.geometry.geometry_error import place
    from mitsuba_taxel.pads.imported.step import mesh_step
    from mitsuba_taxel.pads.imported.surface_meshing import mesh_surface
    from mitsuba_taxel.pads.parametric.meshing import LEAST_QUALITY

    if not (math.isfinite(mesh_size) and mesh_size > 0):
        raise InputError(f"mesh_size = {mesh_size:g} is not allowed: a finite number above 0 is needed.")
    with _naming_file(pad), activity(f"meshing {pad.path.name}, elements of {mesh_size:.3g} mm"):
        content = pad.content()
        if pad.is_drawn:
            mesh = mesh_step(pad.path.resolve(), pad.digest, pad.regions, mesh_size, pad.placement)
        else:
            mesh = mesh_surface(content, pad.suffix, pad.regions, mesh_size, pad.placement)
    quality, where = worst_element(mesh)
    if quality < LEAST_QUALITY:
        raise ComputationError(
            f"the mesh has a distorted element near {place(where)}: choose another mesh_size than {mesh_size:g}."
        )
    return mesh


def default_size_of(pad: PadFile) -> float:
    """Default size of the elements of a pad from a file, in mm. Raises the errors of :func:`mesh_pad_file`."""
    from mitsuba_taxel.pads.imported.local_sizes import default_mesh_size
    from mitsuba_taxel.pads.imported.step import surveyed
    from mitsuba_taxel.pads.imported.surface_meshing import parts_of

    with _naming_file(pad), activity(f"reading {pad.path.name}"):
        content = pad.content()
        if pad.is_drawn:
            body = surveyed(pad.path.resolve(), pad.digest, pad.regions, pad.placement)
            surface = (body.patches.vertices, body.patches.triangles, body.patch_region, body.cell[body.face])
        else:
            surface_part, _, _ = parts_of(content, pad.suffix, pad.regions, pad.placement)
            surface = (surface_part.vertices, surface_part.triangles, surface_part.region, surface_part.cell)
        return default_mesh_size(*surface)


@contextmanager
def _naming_file(pad: PadFile) -> Iterator[None]:
    """Convert a `GeometryError` within the block to an `InputError` that names the file."""
    from mitsuba_taxel.geometry.geometry_error import GeometryError

    try:
        yield
    except GeometryError as error:
        raise InputError(f"filename = {pad.path} is not allowed: {error}.") from error
