"""Light that cannot be read: no LED or phototransistor, walls that return nothing, paths from the wrong end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_taxel.check.faces import faces_of
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.parts import PAD, Part, Parts
from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics.emission import UniformPolarAngle
from mitsuba_taxel.optics.regions import BODY_REGIONS
from mitsuba_taxel.optics.taxels import taxels_of
from mitsuba_taxel.optics.walls import is_bounded_from_detector
from mitsuba_taxel.pads import REGIONS

LARGEST_OFFSET = 0.01
"""Distance from its face at which a ray may start, relative to the face's shorter side."""
_FROM_THE_LIGHT = ("ptracer",)
"""Those of Mitsuba's integrators whose paths start at the light."""


def check_light(parts: Parts) -> Iterator[Finding]:
    """What can be known of the light before any is traced."""
    if parts.sound:
        yield from _pairs(parts)
    for shape in parts.shapes():
        yield from _walls(shape)
    yield from _nothing_comes_back(parts)
    for led in parts.of("annular_led"):
        if float(led.made.power[0]) == 0:
            yield led.finding("warning", "power = 0 of annular_led is no light: all readings are 0.", "power")
    integrators = [part for part in parts.roots if part.kind == "integrator" and part.sound]
    for integrator in integrators[1:]:
        yield integrator.finding("error", "a scene takes one integrator, and this is another: take one of them out.")
    for integrator in integrators:
        yield from _integrator(integrator, parts)
    stock = any(not hasattr(integrator.made, "sample_paths") for integrator in integrators)
    yield from _tables(parts, stock)
    yield from _far_away(parts, stock)


@dataclass
class _Contents:
    """The shapes of a scene, of which nothing can be traced: as much of a scene as `taxels_of` asks."""

    parts: Parts

    def shapes(self) -> list[Any]:
        return [part.made for part in self.parts.shapes() if part.plugin != PAD]

    def emitters(self) -> list[Any]:
        return self._endpoints("emitter")

    def sensors(self) -> list[Any]:
        return self._endpoints("sensor")

    def _endpoints(self, kind: str) -> list[Any]:
        free = [[part] if part.kind == kind else part.nested(kind) for part in self.parts.roots]
        return [part.made for group in free for part in group]


def _pairs(parts: Parts) -> Iterator[Finding]:
    """LEDs and phototransistors that do not pair up, or lie one on the other."""
    try:
        taxels_of(_Contents(parts))
    except InputError as error:
        said = {finding.message for finding in faces_of(parts)[1]}
        if str(error) not in said:
            yield Finding("error", str(error), parts.file, 0)


def _walls(shape: Part) -> Iterator[Finding]:
    """What covers a shape by default, and regions that it does not have."""
    covers = shape.nested("bsdf")
    ours = shape.plugin in (PAD, "photo_reflector")
    if not covers and not ours and shape.made.bsdf() is not None:
        carries = bool(shape.nested("emitter") or shape.nested("sensor"))
        yield shape.finding(
            "note" if carries else "warning",
            f"{shape.plugin} has no bsdf, and Mitsuba makes it a grey that returns half of the light: give it a wall.",
        )
    for cover in covers:
        if not hasattr(cover.made, "walls"):
            continue
        if not ours and not (shape.made.is_mesh() and shape.made.has_attribute("face_region")):
            yield cover.finding(
                "warning", f"{shape.plugin} has no regions, and all of it absorbs: give it a wall instead of a region."
            )
            continue
        if ours:
            names = REGIONS if shape.plugin == PAD else BODY_REGIONS
            for name in set(cover.made.walls) - set(names):
                yield cover.children.get(name, cover).finding(
                    "warning", f"{name} is no region of {shape.plugin}, and covers nothing: {', '.join(names)} are."
                )


def _nothing_comes_back(parts: Parts) -> Iterator[Finding]:
    """Roofs that absorb, and scenes in which everything does."""
    if not parts.sound:
        return
    pads = [part for part in parts.shapes() if part.plugin == PAD]
    for pad in pads:
        dark = [name for name in ("roof", "side") if _absorbs(_cover(pad, name))]
        if "roof" in dark:
            rest = "and so do its sides" if "side" in dark else "and only its sides return light"
            message = f"the roof of {PAD} absorbs, {rest}: give the roof of its region a wall that reflects."
            yield pad.finding("warning", message)
    carriers = [part for part in parts.shapes() if part.nested("emitter") or part.nested("sensor")]
    if pads or not carriers or any(part.plugin != "photo_reflector" for part in carriers):
        return
    others = [part for part in parts.shapes() if part not in carriers]
    if others and all(_absorbs(_cover(part, "")) for part in others):
        yield others[0].finding("warning", "nothing that an LED shines at reflects: all readings are 0.")


def _cover(shape: Part, region: str) -> Any:
    """The BSDF of a region; ``wall`` by default is None, and Mitsuba's own default is the shape's."""
    covers = shape.nested("bsdf")
    if not covers:
        return None if shape.plugin == PAD else shape.made.bsdf()
    made = covers[0].made
    return made.walls.get(region) if hasattr(made, "walls") and region else made


def _absorbs(wall: Any) -> bool:
    reflectance = getattr(wall, "reflectance", None)
    return wall is None or (reflectance is not None and float(reflectance[0]) == 0)


def _integrator(integrator: Part, parts: Parts) -> Iterator[Finding]:
    """Integrators that start at the phototransistor, where that cannot be."""
    made, plugin = integrator.made, integrator.plugin
    if hasattr(made, "sample_paths"):
        for sensor in parts.of("phototransistor"):
            sampler = sensor.made.sampler()
            if not hasattr(sampler, "place"):
                where = next(iter(sensor.nested("sampler")), sensor)
                yield where.finding("error", f"{plugin} needs the sampler owen_sobol, not {where.plugin}.")
    if plugin in _FROM_THE_LIGHT or (hasattr(made, "sample_paths") and plugin != "taxel_path"):
        return
    severity = "error" if plugin == "taxel_path" else "warning"
    from_there = f"{plugin} starts at the phototransistor, from where"
    unbounded = [part for part in parts.of("wall") if not is_bounded_from_detector(part.made)]
    if unbounded:
        wall = f"the isotropic wall of line {unbounded[0].element.line}"
        yield integrator.finding(severity, f"{from_there} {wall} has no bounded variance: use taxel_tracer.")
    for led in parts.of("annular_led"):
        if isinstance(led.made.law, UniformPolarAngle):
            law = f"the law uniform_polar_angle of line {led.element.line}"
            yield integrator.finding(severity, f"{from_there} {law} has no bounded variance: use taxel_tracer.")


def _tables(parts: Parts, stock: bool) -> Iterator[Finding]:
    """Tables of reflectance that do not reach the wavelength of an LED, or are asked for several at once."""
    wavelengths = sorted({led.made.wavelength for led in parts.of("annular_led")})
    for wall in parts.of("wall"):
        if not wall.made.needs_wavelength:
            continue
        if stock and len(wavelengths) > 1:
            several = f"LEDs of {', '.join(f'{nm:g}' for nm in wavelengths)} nm shine at once on a reflectance_table"
            yield wall.finding("error", f"{several}: taxel_tracer takes them one by one.", "reflectance_table")
        for nm in wavelengths:
            try:
                wall.made.set_wavelength(nm)
            except InputError as error:
                yield wall.finding("error", str(error), "reflectance_table")


def _far_away(parts: Parts, stock: bool) -> Iterator[Finding]:
    """Faces so far from the origin that rays start well off them; see `leave` for the distances."""
    for face in faces_of(parts)[0]:
        reach = float(np.abs(face.centres).max())
        offset = 9e-5 * (1 + reach) if stock else 1e-6 * reach
        if offset > LARGEST_OFFSET * face.side:
            start = "rays of Mitsuba's integrators start" if stock else "rays start"
            remedy = ", or use taxel_tracer" if stock else ""
            place = f"{face.part.plugin} lies {reach:.3g} mm from the origin, where {start}"
            far = f"{offset:.2g} mm off its face of {face.side:.3g} mm: move the scene to the origin{remedy}"
            yield face.part.finding("warning", f"{place} {far}.")
