"""Checks of light: walls that reflect nothing, dark LEDs, unsuitable integrators, tables without the wavelength."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from mitsuba_taxel.backend.plugin_objects import make_plugin
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.parts import PAD, SceneObject, SceneObjects
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


def check_light(objects: SceneObjects) -> Iterator[Finding]:
    """Find mistakes in walls, LEDs, integrators and tables of reflectance, without tracing rays."""
    for shape in objects.shapes():
        yield from _walls(shape)
    yield from _nothing_comes_back(objects)
    for led in objects.of("annular_led"):
        if float(led.instance.power[0]) == 0:
            yield led.finding(
                "warning",
                "power = 0 of annular_led: it emits no light, so all readings are 0; a power above 0 is needed.",
                "power",
            )
    integrators = [obj for obj in objects.roots if obj.kind == "integrator" and obj.valid]
    for integrator in integrators[1:]:
        yield integrator.finding(
            "error", "a scene must have one integrator, and this is a second one: take one of them out."
        )
    for integrator in integrators:
        yield from _integrator(integrator, objects)
    yield from _tables(objects)


def check_modelled(objects: SceneObjects) -> list[Finding]:
    """Find properties of a scene that `measure` refuses; all objects must be valid."""
    if not objects.valid:
        return []
    try:
        refuse_unmodelled(_Contents(objects), _integrator_of(objects))
    except InputError as error:
        culprits = [obj for obj in objects.all if error.part is not None and obj.instance is error.part]
        return [culprits[0].finding("error", str(error)) if culprits else Finding("error", str(error), objects.file, 0)]
    return []


def check_prepared(scene: Scene, objects: SceneObjects) -> list[Finding]:
    """Prepare a valid scene as `measure` does, and report what goes wrong: pads are deformed, and a few rays traced.

    Parameters
    ----------
    scene : Scene
        The scene, without errors.
    objects : SceneObjects
        Objects of the scene.

    Returns
    -------
    list[Finding]
        An error if the scene is refused or a computation stops; otherwise warnings of contacts of the pads, and of
        surfaces whose back side absorbs light.
    """
    try:
        built = prepare(scene).scene
    except (InputError, ComputationError) as error:
        return [Finding("error", str(error), objects.file, 0, stopped=isinstance(error, ComputationError))]
    # Order the elements as the shapes of the built scene. Pads are built last: see `Scene.load`.
    roots = sorted((obj for obj in objects.roots if obj.kind == "shape"), key=lambda obj: obj.plugin == PAD)
    shapes = [obj.element for obj in roots]
    if len(shapes) != len(built.shapes()):  # a `merge` is taken apart
        shapes = [objects.roots[0].element] * len(built.shapes())
    touching = [Finding("warning", f"{note}.", objects.file, 0) for note in contact_notes(built)]
    return touching + [
        shapes[number].finding("warning", f"{message}.") for number, message in dark_backs(built).items()
    ]


def _integrator_of(objects: SceneObjects) -> Any:
    integrators = [obj for obj in objects.roots if obj.kind == "integrator"]
    return integrators[0].instance if integrators else make_plugin("taxel_tracer")


@dataclass
class _Contents:
    """Shapes, emitters and sensors of a scene without ray tracing: the interface that `refuse_unmodelled` needs."""

    objects: SceneObjects

    def shapes(self) -> list[Any]:
        return [obj.instance for obj in self.objects.shapes()]

    def emitters(self) -> list[Any]:
        return self._endpoints("emitter")

    def sensors(self) -> list[Any]:
        return self._endpoints("sensor")

    def _endpoints(self, kind: str) -> list[Any]:
        endpoints = []
        for obj in self.objects.roots:
            nested = [obj] if obj.kind == kind else obj.nested(kind)
            endpoints += [endpoint.instance for endpoint in nested]
            if not nested and obj.plugin == "photo_reflector" and obj.instance is not None:  # it creates its own
                endpoints.append(obj.instance.emitter() if kind == "emitter" else obj.instance.sensor())
        return endpoints


def _walls(shape: SceneObject) -> Iterator[Finding]:
    """Warn of shapes with Mitsuba's default BSDF, and of regions that a shape does not have."""
    covers = shape.nested("bsdf")
    has_regions = shape.plugin in (PAD, "photo_reflector")
    if not covers and not has_regions and shape.instance.bsdf() is not None:
        has_endpoint = bool(shape.nested("emitter") or shape.nested("sensor"))
        yield shape.finding(
            "note" if has_endpoint else "warning",
            f"{shape.plugin} has no bsdf, so Mitsuba makes it a grey surface that reflects half of the light: give "
            f"it a wall.",
        )
    for cover in covers:
        if not is_region(cover.instance):
            continue
        if not has_regions and not (shape.instance.is_mesh() and shape.instance.has_attribute("face_region")):
            yield cover.finding(
                "warning",
                f"{shape.plugin} has no regions, so all of its surface absorbs light: give it a wall "
                f"instead of a region.",
            )
            continue
        if has_regions:
            names = REGIONS if shape.plugin == PAD else BODY_REGIONS
            for name in set(cover.instance.walls) - set(names):
                yield cover.children.get(name, cover).finding(
                    "warning",
                    f"{name} is not a region of {shape.plugin}, so its BSDF has no effect: allowed are "
                    f"{', '.join(names)}.",
                )


def _nothing_comes_back(objects: SceneObjects) -> Iterator[Finding]:
    """Warn of scenes in which no light can return to a phototransistor: roofs absorb all light, or all surfaces do."""
    if not objects.valid:
        return
    pads = [obj for obj in objects.shapes() if obj.plugin == PAD]
    for pad in pads:
        absorbing = [name for name in ("roof", "side") if absorbs(_cover(pad, name))]
        if "roof" in absorbing:
            sides = "and so do its sides" if "side" in absorbing else "and only its sides reflect light"
            message = f"the roof of {PAD} absorbs, {sides}: give the roof of its region a wall that reflects."
            yield pad.finding("warning", message)
    # Without pads, photo-reflectors need something that reflects. Other carriers of LEDs are not judged.
    carriers = [obj for obj in objects.shapes() if obj.nested("emitter") or obj.nested("sensor")]
    if pads or not carriers or any(obj.plugin != "photo_reflector" for obj in carriers):
        return
    reflectors = [obj for obj in objects.shapes() if obj not in carriers]
    if reflectors and all(absorbs(_cover(obj, "")) for obj in reflectors):
        yield reflectors[0].finding(
            "warning",
            "no surface in the light of the LEDs reflects, so all readings are 0: give one a wall that reflects.",
        )


def _cover(shape: SceneObject, region: str) -> Any:
    """BSDF of a region of a shape, or of the whole shape if the name of the region is empty. None if a pad has its
    default BSDF there.
    """
    covers = shape.nested("bsdf")
    if not covers:
        return None if shape.plugin == PAD else shape.instance.bsdf()
    bsdf = covers[0].instance
    return wall_at(bsdf, region) if region else bsdf


def _integrator(integrator: SceneObject, objects: SceneObjects) -> Iterator[Finding]:
    """Warn of integrators that start paths at the phototransistor, if the weights of such paths are unbounded."""
    instance, plugin = integrator.instance, integrator.plugin
    if plugin in _FROM_THE_LIGHT or traces_taxels(instance):
        return
    cause = f"{plugin} starts paths at the phototransistor, where"
    unbounded = [obj for obj in objects.of("wall") if not is_bounded_from_detector(obj.instance)]
    if unbounded:
        wall = f"the isotropic wall of line {unbounded[0].element.line}"
        yield integrator.finding("warning", f"{cause} {wall} makes their variance unbounded: use taxel_tracer.")
    for led in objects.of("annular_led"):
        if isinstance(led.instance.law, UniformPolarAngle):
            law = f"the law uniform_polar_angle of line {led.element.line}"
            yield integrator.finding("warning", f"{cause} {law} makes their variance unbounded: use taxel_tracer.")


def _tables(objects: SceneObjects) -> Iterator[Finding]:
    """Find tables of reflectance that do not cover the wavelength of an LED."""
    wavelengths = sorted({led.instance.wavelength for led in objects.of("annular_led")})
    for wall in objects.of("wall"):
        for nm in wavelengths if wall.instance.needs_wavelength else ():
            try:
                wall.instance.table.at(nm)
            except InputError as error:
                yield wall.finding("error", str(error), wall.instance.table.parameter)
