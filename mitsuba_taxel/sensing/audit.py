"""Energy audit: fractions of the emitted power that each surface absorbs, that are detected, and that escape."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.backend.plugin_objects import kind_of, make_plugin
from mitsuba_taxel.base.arguments import check_progress, check_seed, check_whole, plain_number
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.text_table import text_table
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.kernels.paths.ray_offsets import clearance_of
from mitsuba_taxel.kernels.paths.wavefronts import LARGEST_WAVEFRONT
from mitsuba_taxel.kernels.protocols import is_package
from mitsuba_taxel.kernels.surfaces.regions import ALL_REGIONS, CONTACT
from mitsuba_taxel.kernels.taxel_pair import TaxelPair
from mitsuba_taxel.kernels.taxels.windows import transmittance
from mitsuba_taxel.kernels.walls import reflectance_of, scatters, set_wavelength, wall_at
from mitsuba_taxel.sensing.reading.runs import MOST_POINTS, REPLICATES, AnyScene, prepare
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.sensing.validity.ray_paths import PathStep, emit, follow, landed
from mitsuba_taxel.specification.path_depth import MOST_REFLECTIONS

DEFAULT_POINTS = 4096
ENDS = ("detected", "escaped", "lost by single scattering", "unfinished")
"""Ends of light other than surfaces."""

INSIDE = "inside packages"
"""End of light that does not leave the windows above its LED."""

_WEIGHTED_REFLECTIONS = 8


@dataclass(frozen=True)
class EnergyAudit:
    """Fractions of the power of all LEDs by the place where the light ends: on a surface, on a phototransistor or
    outside the scene.

    Attributes
    ----------
    places : tuple[str, ...]
        Names of the P places where light ends. The surfaces come first. A surface is named by the id of its shape or
        else by its kind, followed by the region if the shape has several (``deformable_pad roof``). Its fraction is the
        light that it absorbed; for a window, this includes the light that passed beside the die. ``inside packages`` is
        the light of LED dies that does not leave their windows. The :data:`ENDS` come last: ``detected`` is the light
        that phototransistors absorbed, not weighted by their response; ``escaped`` is the light that left the scene;
        ``lost by single scattering`` is the light that a real rough mirror would reflect by a second facet;
        ``unfinished`` is the power that remains after the largest number of reflections.
    replicates : (R, P) ndarray
        Fractions of the emitted power, for each of R independent randomisations and each of the P places.
    points : int
        Light paths for each LED and replicate.
    seed : int
        Seed of the random numbers.
    """

    places: tuple[str, ...]
    replicates: np.ndarray
    points: int
    seed: int

    def __str__(self) -> str:
        return audit_text(self)

    @property
    def share(self) -> np.ndarray:
        """Fraction (P,) of the emitted power that ends at each of the P places."""
        return self.replicates.mean(axis=0)

    @property
    def standard_error(self) -> np.ndarray:
        """Standard error (P,) of :attr:`share`, from the scatter of the replicates."""
        return standard_error(self.replicates)

    @property
    def total(self) -> float:
        """Sum of all fractions: 1 up to rounding, because all power of each path is accounted for."""
        return float(self.share.sum())

    @property
    def total_error(self) -> float:
        """Standard error of :attr:`total`."""
        return float(standard_error(self.replicates.sum(axis=1)))


@in_turn
def energy_audit(
    scene: AnyScene,
    *,
    points: int = DEFAULT_POINTS,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> EnergyAudit:
    """Energy balance of a scene: the fraction of the LEDs' power that each surface absorbs, that is detected, and that
    escapes.

    Light paths start at the LEDs, and the scene's BSDFs are sampled at each reflection, so that the power of a path
    never grows. Absorbed power is summed at each wall in double precision. Two runs with the same seed agree to about
    1e-12, because the order of summation varies. If the integrator has a ``max_depth``, paths end there too.

    Parameters
    ----------
    scene : Scene or str or Path or dict or mi.Scene or Prepared
        A :class:`Scene`, a path or name of an XML scene, a dictionary, a loaded ``mi.Scene``, or the result of
        :func:`prepare`.
    points : int
        Light paths for each LED and replicate, up to 1048576; rounded up to a power of two.
    seed : int
        Whole number from 0 to 2**32 - 1.
    progress : Callable[[int, int], None], optional
        Called with the number of finished sequences of points and the number of all sequences: one for each LED and
        replicate.

    Returns
    -------
    EnergyAudit
        Fraction of the emitted power that ends at each place, with its standard error.

    Raises
    ------
    InputError
        if a value is not allowed, or the scene cannot be built or has no `annular_led` with power.
    ComputationError
        if a pad cannot bear its load.
    """
    check_whole("points", points, 1, MOST_POINTS)
    check_seed(seed)
    points, seed = plain_number(points), plain_number(seed)
    check_progress(progress)
    ready = prepare(scene)
    pairs = taxels_of(ready.scene)
    emitted = sum(pair.count * pair.led.power[0] for pair in pairs)
    if not emitted > 0:
        raise InputError("the scene has no annular_led with a power above 0: add one, or raise its power.")
    limit = getattr(ready.integrator, "max_depth", -1)
    limit = MOST_REFLECTIONS if limit < 0 else limit
    surfaces = _Surfaces(ready.scene)
    replicates, points = _trace_all(ready.scene, pairs, surfaces, int(points), int(seed), limit, progress or _silent)
    return EnergyAudit(*surfaces.sort(replicates / emitted), points, seed)


def _silent(done: int, total: int) -> None:
    """Replacement for a progress function; does nothing."""


def _trace_all(
    scene, pairs: list[TaxelPair], surfaces: _Surfaces, points: int, seed: int, limit: int, progress
) -> tuple[np.ndarray, int]:
    """Trace paths from all LEDs. Returns the power (R, P) in W that ends at each of P places after at most ``limit``
    reflections, for each of R replicates, and the number of points of each LED and replicate."""
    sampler = make_plugin("owen_sobol", sample_count=points)
    points = sampler.sample_count()
    sums = dr.zeros(mi.Float64, REPLICATES * (len(surfaces.places) + len(ENDS)))
    dr.make_opaque(sums)
    total = REPLICATES * sum(pair.count for pair in pairs)
    at_once = max(1, LARGEST_WAVEFRONT // points)
    first = 0
    for pair in pairs:
        set_wavelength(scene, [pair.led])
        surfaces.read_reflectances()
        last = first + REPLICATES * pair.count
        for start in range(first, last, at_once):
            sequences = min(at_once, last - start)
            sampler.place(0, start)
            sampler.seed(seed, sequences * points)
            sequence = sampler.sequence - dr.opaque(mi.UInt32, first)
            _trace(scene, pairs, pair, sampler, sequence, surfaces, limit, sums)
            dr.eval(sums)
            progress(start + sequences, total)
        first = last
    return sums.numpy().reshape(REPLICATES, -1) / points, points


def _trace(
    scene,
    pairs: list[TaxelPair],
    pair: TaxelPair,
    sampler,
    sequence: mi.UInt32,
    surfaces: _Surfaces,
    limit: int,
    sums: mi.Float64,
) -> None:
    """Trace a path from an LED of ``pair`` for each entry of ``sequence``, and add the power in W that ends at each
    place to ``sums``."""
    index = sequence % dr.opaque(mi.UInt32, pair.count)
    replicate = sequence // dr.opaque(mi.UInt32, pair.count)
    first_end = len(surfaces.places)
    row = replicate * (first_end + len(ENDS))
    detected, escaped, lost, unfinished = (row + (first_end + i) for i in range(len(ENDS)))
    most_reflections = dr.opaque(mi.UInt32, limit)

    def book(step: PathStep) -> None:
        surface = surfaces.at(step)
        kept = mi.Float64(step.power) - mi.Float64(step.onward)
        unseen = kept * mi.Float64(surfaces.unseen_fraction(surface, step))
        column, ends_here = dr.select(step.hit, row + surface, escaped), kept - unseen
        for receiver in pairs:
            here, _ = landed(receiver, step)
            column = dr.select(here, detected, column)
            if receiver.sensor.resin_index is not None:
                through = transmittance(receiver.sensor.resin_index, -dr.dot(step.ray.d, receiver.sensor.normal))
                refused = ends_here * (1 - mi.Float64(through)) & (step.active & here)
                dr.scatter_add(sums, refused, row + surface, refused != 0)
                ends_here -= refused
        dr.scatter_add(sums, ends_here, column, step.active)
        dr.scatter_add(sums, unseen, lost, unseen != 0)
        dr.scatter_add(sums, mi.Float64(step.onward), unfinished, step.hit & (step.depth >= most_reflections))

    _, ray, passed = emit(scene, pair, index, sampler)
    power = mi.Float(pair.led.power) + dr.zeros(mi.Float, dr.width(sequence))
    if pair.is_below_windows:
        inside = mi.Float64(power) * (1 - mi.Float64(passed))
        dr.scatter_add(sums, inside, row + dr.opaque(mi.UInt32, surfaces.places.index(INSIDE)))
        power *= passed
    follow(scene, ray, power, clearance_of(scene, pair), sampler, limit, _WEIGHTED_REFLECTIONS, book)


class _Surfaces:
    """All surfaces of a scene: each region of meshes with regions, and each other shape.

    ``places`` are their names; the last is for shapes that the scene does not list, such as those of an instance.
    """

    def __init__(self, scene: mi.Scene) -> None:
        shapes = scene.shapes()
        self.places: list[str] = []
        self.bsdfs: list[mi.BSDF | None] = []
        self.sensitive: list[int] = []
        tables: list[np.ndarray] = []
        numbers = [int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]) for shape in shapes]
        starts = np.zeros(max(numbers, default=0) + 2, np.uint32)
        strides = np.zeros_like(starts)
        position = 1
        for shape, name, number in zip(shapes, _names(shapes), numbers, strict=True):
            table = self._add(shape, name)
            tables.append(table)
            starts[number], strides[number] = position, len(table) > 1
            position += len(table)
        if any(led.resin_index is not None for led in scene.emitters()):
            self.places.append(INSIDE)
            self.bsdfs.append(None)
        self.places.append("other shapes")
        self.bsdfs.append(None)
        unlisted = np.array([len(self.places) - 1])
        self.table = mi.UInt32(in_packets(np.concatenate([unlisted, *tables]), np.uint32))
        self.starts, self.strides = (mi.UInt32(in_packets(table, np.uint32)) for table in (starts, strides))
        self.last = dr.opaque(mi.UInt32, len(starts) - 1)

    def _add(self, shape: mi.Shape, name: str) -> np.ndarray:
        """Register the surfaces of a shape; returns the number of the surface for each triangle, or one for all."""
        first, bsdf = len(self.places), shape.bsdf()
        if not (shape.is_mesh() and shape.has_attribute("face_region")[0]):
            self.places.append(name)
            self.bsdfs.append(bsdf)
            return np.array([first])
        codes = np.rint(np.array(mi.traverse(shape)["face_region"])).astype(int)
        is_bare = not (is_package(shape) and shape.resin_index)
        present, inverse = np.unique(codes, return_inverse=True)
        words = {CONTACT: "in contact"} | {code: word for word, code in ALL_REGIONS.items()}
        for code in present:
            region = words.get(int(code), f"region {code}")
            if region == "phototransistor" and is_bare:
                self.sensitive.append(len(self.places))
            self.places.append(f"{name} {region}")
            self.bsdfs.append(wall_at(bsdf, region))
        return first + inverse

    def read_reflectances(self) -> None:
        """Store the reflectance of each rough mirror at the present wavelength, for :meth:`unseen_fraction`; 0 for all
        other surfaces."""
        values = [reflectance_of(bsdf) if scatters(bsdf, "rough_mirror") else 0.0 for bsdf in self.bsdfs]
        self.reflectance = mi.Float(in_packets(np.array(values)))

    def at(self, step: PathStep) -> mi.UInt32:
        """The number of the surface that is hit in a step of light paths."""
        number = dr.minimum(dr.reinterpret_array(mi.UInt32, step.si.shape), self.last)
        start = dr.gather(mi.UInt32, self.starts, number, step.hit)
        stride = dr.gather(mi.UInt32, self.strides, number, step.hit)
        return dr.gather(mi.UInt32, self.table, start + stride * step.si.prim_index, step.hit)

    def unseen_fraction(self, surface: mi.UInt32, step: PathStep) -> mi.Float:
        """Fraction of the light ending at a rough mirror that a real mirror would reflect by a second facet."""
        reflectance = dr.gather(mi.Float, self.reflectance, surface, step.hit)
        return dr.select(step.weight < reflectance, (reflectance - step.weight) / (1 - step.weight), 0)

    def sort(self, shares: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
        """Prepare the fractions of the light by the place where it ends for output.

        Light that ends on a package's region ``phototransistor`` missed the phototransistor only by rounding, just
        outside its rim. It is added to the detected light, and these regions are left out. The shapes that the scene
        does not list are left out too if no light ends there.

        Parameters
        ----------
        shares : (R, P) ndarray
            Fraction of the emitted power by replicate and place: ``places``, then `ENDS`. It is changed in place.

        Returns
        -------
        names : tuple of str
            Names of the places that remain.
        shares : (R, names) ndarray
            Their fractions.
        """
        listed = len(self.places) - 1
        shares[:, listed + 1] += shares[:, self.sensitive].sum(axis=1)
        hidden = self.sensitive if shares[:, listed].any() else [*self.sensitive, listed]
        names = np.delete(np.array([*self.places, *ENDS]), hidden)
        return tuple(names.tolist()), np.delete(shares, hidden, axis=1)


def _names(shapes: list[mi.Shape]) -> list[str]:
    """Name of each shape: its id, or its kind, with a number if several have the same name."""
    names = [shape.id() or kind_of(shape) for shape in shapes]
    alike, used = Counter(names), Counter[str]()
    result = []
    for name in names:
        used[name] += 1
        result.append(f"{name} {used[name]}" if alike[name] > 1 else name)
    return result


def audit_text(audit: EnergyAudit, width: int | None = None) -> str:
    """An energy audit as text: a table of places, fractions of the emitted power and standard errors.

    Parameters
    ----------
    audit : EnergyAudit
        Audit of a scene.
    width : int, optional
        Width of a line in characters.

    Returns
    -------
    str
        A title and a table.
    """
    rows = [
        *zip(audit.places, audit.share, audit.standard_error, strict=True),
        ("total", audit.total, audit.total_error),
    ]
    cells = ((name, f"{fraction:.6f}", f"{error:.1e}") for name, fraction, error in rows)
    table = text_table(("place", "share", "standard error"), cells, width)
    return f"Energy audit: share of the power that all LEDs emit\n{table}"
