"""Interfaces of our plugins, and predicates that tell them from Mitsuba's own and from third-party ones.

A scene returns Mitsuba's objects, whose classes are hidden from Python; ours are recognised by attributes that only
they have.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard

import mitsuba as mi

if TYPE_CHECKING:
    import numpy as np

    from mitsuba_taxel.kernels.cell_surface import CellSurface
    from mitsuba_taxel.kernels.emission_guiding import GuidedEmission
    from mitsuba_taxel.kernels.faces import FaceGrid
    from mitsuba_taxel.kernels.guide import Guide
    from mitsuba_taxel.kernels.mesh_adapter import Places
    from mitsuba_taxel.kernels.taxel_pair import TaxelPair


class TaxelEnd(Protocol):
    """Common interface of `annular_led` and `phototransistor`."""

    specification: Any

    @property
    def faces(self) -> FaceGrid: ...
    def get_shape(self) -> Any: ...


class Led(TaxelEnd, Protocol):
    """An `annular_led`, one or an array."""

    power: mi.Float
    wavelength: float

    @property
    def area(self) -> mi.Float: ...
    def sample_point(self, index: mi.UInt32, sample: mi.Point2f) -> mi.Point3f: ...
    def sample_direction_of_emission(self, sample: mi.Point2f) -> mi.Vector3f: ...
    def density_of_direction(self, d: mi.Vector3f) -> mi.Float: ...
    def contains(self, index: mi.UInt32, p: mi.Point3f) -> mi.Bool: ...


class Phototransistor(TaxelEnd, Protocol):
    """A `phototransistor`, one or an array, with what pilot runs have learned (None: not yet).

    ``guide`` holds the vertices for which it was found, and the guide, or None where it does not pay.
    """

    guided_emission: GuidedEmission | None
    guide: tuple[np.ndarray, Guide | None] | None

    @property
    def normal(self) -> mi.Vector3f: ...
    def film(self) -> Any: ...
    def sampler(self) -> Any: ...
    def spread_film(self, rows: int, columns: int) -> None: ...
    def responsivity(self, wavelength_nm: float) -> float: ...
    def response(self, cosine: mi.Float) -> mi.Float: ...
    def sample_point(self, index: mi.UInt32, sample: mi.Point2f) -> tuple[mi.Point3f, mi.Point2f]: ...
    def contains(self, index: mi.UInt32, p: mi.Point3f) -> tuple[mi.Bool, mi.Point2f]: ...
    def pixel(self, index: mi.UInt32, offset: mi.Point2f) -> mi.Point2f: ...


class Package(Protocol):
    """A `photo_reflector`: the sides of its ``body``, and where along x the faces' ``centres`` lie."""

    body: np.ndarray
    centres: dict[str, float]

    def face_grid(self, name: str) -> FaceGrid: ...
    def is_as_built(self) -> bool: ...


class PadShape(Protocol):
    """A `deformable_pad`: the solid ``pad``, the ``value`` of its load and its ``history`` (times and values, the last
    ones at present), and its ``state`` and ``surface`` under load."""

    pad: Any
    material: Any
    load: Any
    value: Any
    history: tuple[list[float], list[tuple[float, ...]]]
    prony: tuple[tuple[float, float], ...]
    mesh_size: float | None
    mesh_tolerance: float | None
    finish: Any
    state: Any
    surface: Any
    contact_pressure: np.ndarray | None
    to_world: np.ndarray
    ptr: int

    @property
    def undeformed(self) -> CellSurface: ...
    def bsdf(self) -> Any: ...
    def closed(self) -> Any: ...
    def deviating_places(self) -> list[Places] | None: ...
    def moved_places(self, state: Any, pad: Any, chords: bool = False) -> Places: ...
    @property
    def is_loaded(self) -> bool: ...
    @property
    def is_curved(self) -> bool: ...
    @property
    def loaded_mesh_size(self) -> float | None: ...
    def at_onset(self) -> Any: ...
    def state_under(self, value: Any, obstacles: Any = None) -> Any: ...
    def heed(self, obstacles: np.ndarray) -> bool: ...
    def second_state(self) -> Any: ...


class Region(Protocol):
    """A `region`: BSDFs by the name of the region."""

    walls: Mapping[str, Any]


class TaxelIntegrator(Protocol):
    """One of our integrators, which trace a pair of LED and phototransistor."""

    def sample_paths(
        self, scene: Any, pair: TaxelPair, index: Any, led_index: Any, sampler: Any, pixels: Any
    ) -> Any: ...


def is_led(emitter: Any) -> TypeGuard[Led]:
    return hasattr(emitter, "sample_direction_of_emission")


def is_phototransistor(sensor: Any) -> TypeGuard[Phototransistor]:
    return hasattr(sensor, "spread_film")


def has_faces(end: Any) -> TypeGuard[TaxelEnd]:
    return is_led(end) or is_phototransistor(end)


def is_package(shape: Any) -> TypeGuard[Package]:
    return hasattr(shape, "face_grid")


def is_pad(shape: Any) -> TypeGuard[PadShape]:
    return hasattr(shape, "state")


def has_pad(shape: Any) -> bool:
    """Whether it is a `deformable_pad`, or a stand-in for one that is not solved."""
    return hasattr(shape, "pad")


def is_region(bsdf: Any) -> TypeGuard[Region]:
    return hasattr(bsdf, "walls")


def traces_taxels(integrator: Any) -> TypeGuard[TaxelIntegrator]:
    return hasattr(integrator, "sample_paths")


def guides_emission(integrator: Any) -> bool:
    return hasattr(integrator, "sample_guided")


def is_owen_sobol(sampler: Any) -> bool:
    return hasattr(sampler, "place")
