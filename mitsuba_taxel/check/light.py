"""Findings on light: no LED or phototransistor, walls that reflect nothing, paths from the wrong end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from mitsuba_taxel.backend.plugin_objects import make_plugin
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.parts import PAD, Parts, ScenePart
from mitsuba_taxel.kernels.paths.taxel_integrators import traces_taxels
from mitsuba_taxel.kernels.protocols import is_region
from mitsuba_taxel.kernels.surfaces.regions import BODY_REGIONS
from mitsuba_taxel.kernels.taxels.emission import UniformPolarAngle
from mitsuba_taxel.kernels.walls import absorbs, is_bounded_from_detector, wall_at
from mitsuba_taxel.pads import REGIONS
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.scene_pads import contact_notes
from mitsuba_taxel.sensing.validity.dark_backs import dark_backs
from mitsuba_taxel.sensing.validity.modelled import refuse_unmodelled

_FROM_THE_LIGHT = ("ptracer",)
"""Mitsuba's integrators whose paths start at the light."""


def check_light(parts: Parts) -> Iterator[Finding]:
    """Findings on the light without tracing."""
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
    yield from _tables(parts)


def check_modelled(parts: Parts) -> list[Finding]:
    """What `measure` refuses in a scene whose parts were all made."""
    if not parts.sound:
        return []
    try:
        refuse_unmodelled(_Contents(parts), _integrator_of(parts))
    except InputError as error:
        guilty = [part for part in parts.all if error.part is not None and part.made is error.part]
        return [guilty[0].finding("error", str(error)) if guilty else Finding("error", str(error), parts.file, 0)]
    return []


def check_prepared(scene: Scene, parts: Parts) -> list[Finding]:
    """What `measure` refuses of a sound scene when pads are deformed, and after a few rays; what pads touch, and black
    backs."""
    try:
        live = prepare(scene).scene
    except (InputError, ComputationError) as error:
        return [Finding("error", str(error), parts.file, 0, stopped=isinstance(error, ComputationError))]
    # Pads are built last: see `Scene.load`.
    built = sorted((part for part in parts.roots if part.kind == "shape"), key=lambda part: part.plugin == PAD)
    shapes = [part.element for part in built]
    if len(shapes) != len(live.shapes()):  # a `merge` is taken apart
        shapes = [parts.roots[0].element] * len(live.shapes())
    touching = [Finding("warning", f"{note}.", parts.file, 0) for note in contact_notes(live)]
    return touching + [shapes[number].finding("warning", f"{said}.") for number, said in dark_backs(live).items()]


def _integrator_of(parts: Parts) -> Any:
    integrators = [part for part in parts.roots if part.kind == "integrator"]
    return integrators[0].made if integrators else make_plugin("taxel_tracer")


@dataclass
class _Contents:
    """The shapes of a scene without ray tracing: the part of a scene that `refuse_unmodelled` needs."""

    parts: Parts

    def shapes(self) -> list[Any]:
        return [part.made for part in self.parts.shapes()]

    def emitters(self) -> list[Any]:
        return self._endpoints("emitter")

    def sensors(self) -> list[Any]:
        return self._endpoints("sensor")

    def _endpoints(self, kind: str) -> list[Any]:
        found = []
        for part in self.parts.roots:
            given = [part] if part.kind == kind else part.nested(kind)
            found += [one.made for one in given]
            if not given and part.plugin == "photo_reflector" and part.made is not None:  # a part has its own
                found.append(part.made.emitter() if kind == "emitter" else part.made.sensor())
        return found


def _walls(shape: ScenePart) -> Iterator[Finding]:
    """Shapes with a default BSDF, and regions that a shape does not have."""
    covers = shape.nested("bsdf")
    ours = shape.plugin in (PAD, "photo_reflector")
    if not covers and not ours and shape.made.bsdf() is not None:
        carries = bool(shape.nested("emitter") or shape.nested("sensor"))
        yield shape.finding(
            "note" if carries else "warning",
            f"{shape.plugin} has no bsdf, and Mitsuba makes it a grey that returns half of the light: give it a wall.",
        )
    for cover in covers:
        if not is_region(cover.made):
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
    """Absorbing roofs, and scenes in which everything absorbs."""
    if not parts.sound:
        return
    pads = [part for part in parts.shapes() if part.plugin == PAD]
    for pad in pads:
        dark = [name for name in ("roof", "side") if absorbs(_cover(pad, name))]
        if "roof" in dark:
            rest = "and so do its sides" if "side" in dark else "and only its sides return light"
            message = f"the roof of {PAD} absorbs, {rest}: give the roof of its region a wall that reflects."
            yield pad.finding("warning", message)
    carriers = [part for part in parts.shapes() if part.nested("emitter") or part.nested("sensor")]
    if pads or not carriers or any(part.plugin != "photo_reflector" for part in carriers):
        return
    others = [part for part in parts.shapes() if part not in carriers]
    if others and all(absorbs(_cover(part, "")) for part in others):
        yield others[0].finding("warning", "nothing that an LED shines at reflects: all readings are 0.")


def _cover(shape: ScenePart, region: str) -> Any:
    """The BSDF of a region; None for the default of a ``wall``, or Mitsuba's default for the shape."""
    covers = shape.nested("bsdf")
    if not covers:
        return None if shape.plugin == PAD else shape.made.bsdf()
    made = covers[0].made
    return wall_at(made, region) if region else made


def _integrator(integrator: ScenePart, parts: Parts) -> Iterator[Finding]:
    """Mitsuba's integrators that start at the phototransistor, if weights from there are unbounded."""
    made, plugin = integrator.made, integrator.plugin
    if plugin in _FROM_THE_LIGHT or traces_taxels(made):
        return
    from_there = f"{plugin} starts at the phototransistor, from where"
    unbounded = [part for part in parts.of("wall") if not is_bounded_from_detector(part.made)]
    if unbounded:
        wall = f"the isotropic wall of line {unbounded[0].element.line}"
        yield integrator.finding("warning", f"{from_there} {wall} has no bounded variance: use taxel_tracer.")
    for led in parts.of("annular_led"):
        if isinstance(led.made.law, UniformPolarAngle):
            law = f"the law uniform_polar_angle of line {led.element.line}"
            yield integrator.finding("warning", f"{from_there} {law} has no bounded variance: use taxel_tracer.")


def _tables(parts: Parts) -> Iterator[Finding]:
    """Tables of reflectance that do not cover the wavelength of an LED."""
    wavelengths = sorted({led.made.wavelength for led in parts.of("annular_led")})
    for wall in parts.of("wall"):
        for nm in wavelengths if wall.made.needs_wavelength else ():
            try:
                wall.made.table.at(nm)
            except InputError as error:
                yield wall.finding("error", str(error), "reflectance_table")
