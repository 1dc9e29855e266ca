"""The energy audit: its sum, closed forms, the readings, and what single scattering loses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel import InputError, Scene, measure
from mitsuba_taxel.sensing import crosstalk
from mitsuba_taxel.sensing.audit import ENDS, energy_audit

POINTS = 256
LEAK = 0.02
"""Most that escapes from a closed cell of reflectance 0.9: rays that leave from the very edge may start beyond it."""
LAWS = {
    "lambertian": {"scattering": "lambertian"},
    "isotropic": {"scattering": "isotropic"},
    "mirror": {"scattering": "mirror"},
    "rough": {"scattering": "rough_mirror", "rms_slope": 30.0},
    "mixed": {"scattering": "mixed", "specular": 0.3, "lambertian": 0.3, "isotropic": 0.4},
}


def wall(law, reflectance=1.0):
    return {"type": "wall", "reflectance": reflectance, **LAWS[law]}


def reflector(bsdf=None, **led):
    """One photo-reflector; its LED is at x = -0.45, z = 0.5."""
    parts = {"emitter": {"type": "annular_led", **led}, "sensor": {"type": "phototransistor"}}
    return {"type": "photo_reflector", **parts, **({} if bsdf is None else {"bsdf": bsdf})}


def all_but_the_detector(law):
    """A photo-reflector's surface that reflects everything outside the light-sensitive area."""
    return {"type": "region", "body": wall(law), "led": wall(law)}


def box(mi, bsdf):
    """Six walls round the photo-reflector, with room below it."""
    place = mi.ScalarTransform4f().translate([0, 0, 0.9]).scale(1.0)
    return {"type": "cube", "to_world": place, "bsdf": bsdf}


def plate(mi, bsdf, height=1.0, tilt=0.0):
    """A rectangle of 4 x 3 mm over the LED, facing down, turned round the y axis by an angle in degrees."""
    place = mi.ScalarTransform4f().translate([-0.45, 0, 0.5 + height]).rotate([0, 1, 0], tilt)
    return {"type": "rectangle", "to_world": place.rotate([1, 0, 0], 180).scale([2, 1.5, 1]), "bsdf": bsdf}


def scene(max_depth=-1, **shapes):
    return Scene({"type": "scene", "integrator": {"type": "taxel_tracer", "max_depth": max_depth}, **shapes})


def audit(description, **request):
    """Shares and standard errors by place, once the sum has been found to be 1."""
    result = energy_audit(description, **{"points": POINTS, **request})
    assert result.total == pytest.approx(1, abs=1e-9) and result.total_error < 1e-9
    assert np.all(result.replicates > -1e-6)
    return dict(zip(result.places, zip(result.share, result.standard_error, strict=True), strict=True))


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("law", LAWS)
def test_sum_is_one(llvm_mono, law, closed):
    """Under a plate, and in a box so bright that most paths end by chance."""
    surface = box(llvm_mono, wall(law, 0.95)) if closed else plate(llvm_mono, wall(law, 0.8))
    shares = audit(scene(pr=reflector(wall(law, 0.9), power=0.013), surface=surface))
    assert shares["detected"][0] > 0 and shares["surface"][0] > 0.05 and shares["unfinished"][0] == 0
    assert shares["escaped"][0] < LEAK if closed else shares["escaped"][0] > 0.05
    assert (shares["lost by single scattering"][0] > 0) == (law == "rough")


@pytest.mark.parametrize("law", LAWS)
def test_what_nothing_else_absorbs_is_detected(llvm_mono, law):
    """In a closed cell of reflectance 1; a rough mirror loses the rest."""
    shares = audit(scene(pr=reflector(all_but_the_detector(law)), cell=box(llvm_mono, wall(law))), points=16)
    absorbed = sum(shares[place][0] for place in ("cell", "pr body", "pr led"))
    assert shares["detected"][0] > 0.01 and absorbed == pytest.approx(0, abs=1e-6)
    assert shares["escaped"][0] < 10 * LEAK and shares["unfinished"][0] == 0


@pytest.mark.parametrize("reflectance", [0.0, 0.4])
@pytest.mark.parametrize("height", [0.5, 2.0])
def test_plate_absorbs_by_the_view_factor(llvm_mono, agree, height, reflectance):
    """From a small Lambertian LED to a parallel rectangle centred above it."""
    a, b = 2 / height, 1.5 / height
    u, v = math.sqrt(1 + a * a), math.sqrt(1 + b * b)
    view_factor = 2 / math.pi * (a / u * math.atan(b / u) + b / v * math.atan(a / v))
    led = {"law": "lambertian", "size": 1e-3, "hole": 0.0}
    shares = audit(scene(pr=reflector(**led), plate=plate(llvm_mono, wall("lambertian", reflectance), height)))
    agree(*shares["plate"], (1 - reflectance) * view_factor, reference_error=1e-6)
    if reflectance == 0:
        agree(*shares["escaped"], 1 - view_factor, reference_error=1e-6)


@pytest.mark.parametrize("law", ["mirror", "mixed", "rough"])
def test_detected_is_the_reading(llvm_mono, agree, law):
    description = scene(pr=reflector(wall("lambertian", 0.5)), cell=box(llvm_mono, wall(law, 0.7)))
    readings = measure(description, points=1024)
    agree(*audit(description, points=4096)["detected"], readings.power, readings.standard_error)


def test_share_is_of_all_leds(llvm_mono, agree):
    """Two taxels of half a watt each: detected is what each LED brings to each phototransistor."""
    array = {**reflector(power=0.5), "rows": 1, "columns": 2}
    description = scene(pr=array, plate=plate(llvm_mono, wall("lambertian")))
    matrix = crosstalk(description, points=1024)
    assert matrix.power[0, 1] > 0.01 * matrix.power[0, 0]
    error = np.sqrt(np.square(matrix.standard_error).sum())
    agree(*audit(description, points=4096)["detected"], matrix.power.sum(), error)


def test_light_on_any_phototransistor_is_detected(llvm_mono):
    """Two LEDs with narrow beams, each under the phototransistor of the other."""
    at = llvm_mono.ScalarTransform4f().translate
    led = {"type": "annular_led", "law": "uniform_solid_angle", "cone_angle": 1.0}
    sensor = {"type": "phototransistor", "width": 1.0, "depth": 1.0}
    absorbing = {"type": "wall", "scattering": "absorbing"}
    shapes = {}
    for number, x in enumerate((-2, 2)):
        facing_down = at([-x, 0, 1]).rotate([1, 0, 0], 180)
        shapes[f"led{number}"] = {"type": "rectangle", "to_world": at([x, 0, 0]), "emitter": led}
        shapes[f"sensor{number}"] = {
            "type": "rectangle",
            "to_world": facing_down,
            "sensor": sensor,
            "bsdf": absorbing,
        }
    assert audit(scene(**shapes))["detected"][0] == pytest.approx(1, abs=1e-6)


def beckmann_albedo(angle, slope):
    """Share of light that a perfectly reflecting Beckmann surface returns by one reflection.

    Midpoint rule over the slopes p, q of the facets (B. Walter et al., EGSR 2007): each is met in proportion to its
    area projected towards the light, and seen on the way out with Smith's G1.
    """
    from scipy.special import erf

    sigma, theta = math.tan(math.radians(slope)), math.radians(angle)

    def visible(cosine):
        a = cosine / np.sqrt(np.maximum(1 - cosine**2, 1e-30)) / (math.sqrt(2) * sigma)
        return 2 / (1 + erf(a) + np.exp(-(a**2)) / (a * math.sqrt(math.pi)))

    step = 12 * sigma / 1200
    p, q = np.meshgrid(*2 * [(np.arange(1200) + 0.5) * step - 6 * sigma])
    density = np.exp(-(p**2 + q**2) / (2 * sigma**2)) / (2 * math.pi * sigma**2)
    facing = np.maximum(math.cos(theta) - math.sin(theta) * p, 0)
    wo_z = 2 * facing / (1 + p**2 + q**2) - math.cos(theta)
    seen = np.where(wo_z > 0, visible(np.maximum(wo_z, 1e-9)), 0)
    return visible(math.cos(theta)) / math.cos(theta) * float((density * facing * seen).sum()) * step**2


@pytest.mark.parametrize("angle, slope", [(0, 20), (50, 20), (50, 40)])
def test_loss_by_single_scattering(llvm_mono, agree, angle, slope):
    """A narrow beam on a tilted rough mirror, against quadrature over its facets."""
    rough = {"type": "wall", "scattering": "rough_mirror", "rms_slope": float(slope), "reflectance": 0.8}
    beam = reflector(law="uniform_solid_angle", cone_angle=0.05)
    shares = audit(scene(pr=beam, plate=plate(llvm_mono, rough, 3.0, float(angle))), points=4096)
    loss = 0.8 * (1 - beckmann_albedo(angle, slope))
    agree(*shares["lost by single scattering"], loss, reference_error=1e-5)
    assert shares["plate"][0] == pytest.approx(0.2, abs=1e-6)


def test_paths_end_with_the_integrators(llvm_mono):
    """Without reflections, what a perfect mirror would send back stays unfinished."""
    shares = audit(scene(max_depth=0, pr=reflector(), plate=plate(llvm_mono, wall("mirror"))))
    assert shares["unfinished"][0] > 0.5 and shares["detected"][0] == 0
    assert shares["unfinished"][0] + shares["escaped"][0] == pytest.approx(1, abs=1e-6)


def test_places_have_names(llvm_mono, tmp_path):
    """Ids come first, then kinds, with numbers where they would be the same."""
    rectangle = '<shape type="rectangle"{}> <transform name="to_world"><translate z="{}"/></transform> </shape>'
    file = tmp_path / "scene.xml"
    file.write_text(
        '<scene version="3.9.0"> <integrator type="taxel_tracer"/> <shape type="photo_reflector">'
        '<emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>'
        + rectangle.format("", 1)
        + rectangle.format(' id="lid"', 2)
        + rectangle.format("", 3)
        + "</scene>"
    )
    places = energy_audit(file, points=1).places
    surfaces = ("photo_reflector body", "photo_reflector led", "rectangle 1", "lid", "rectangle 2")
    assert places == (*surfaces, *ENDS)


def test_seed_and_points(llvm_mono):
    description = scene(pr=reflector(), plate=plate(llvm_mono, wall("lambertian")))
    first, again, other = (energy_audit(description, points=100, seed=seed) for seed in (1, 1, 2))
    assert first.points == 128 and first.seed == 1
    assert first.replicates == pytest.approx(again.replicates, abs=1e-12)
    assert not np.allclose(first.replicates, other.replicates)


@pytest.mark.parametrize("request_, culprit", [({"points": 0}, "points"), ({"seed": -1}, "seed")])
def test_bad_requests(llvm_mono, request_, culprit):
    with pytest.raises(InputError, match=culprit):
        energy_audit(scene(pr=reflector()), **request_)


def test_without_light_there_is_nothing_to_account_for(llvm_mono):
    with pytest.raises(InputError, match="annular_led"):
        energy_audit(scene(pr=reflector(power=0.0)))
