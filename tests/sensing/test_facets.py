"""Domes against the sphere that they are: quadrature and rays of our own for unloaded cells, finer cuts for loaded."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from mitsuba_taxel import Scene, measure
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.evidence.domes.domes import dome_scene as scene
from mitsuba_taxel.evidence.domes.sphere_light import DOMES
from mitsuba_taxel.sensing.audit import energy_audit

DIFFUSE, MIRROR = 3e-4, 3e-3
"""Relative, what facets may change at the default settings."""


@cache
def diffuse_truth(cell, law):
    """Power under a dome whose roof scatters all light."""
    return DOMES[cell].diffuse_power(law, 18)


@cache
def mirror_truth(cell, rms_slope=0.0):
    """Power under a dome with a mirror for a roof, and its standard error."""
    return DOMES[cell].mirror_power(rms_slope)


def agrees(readings, truth, truth_error, within):
    """All taxels of an unloaded pad are alike: their mean, within what is allowed and four standard errors."""
    error = readings.replicates.mean(axis=1).std(ddof=1) / math.sqrt(32)
    assert error < 3 * within * truth
    assert abs(readings.power.mean() - truth) < within * truth + 4 * math.hypot(error, truth_error)


def test_the_quadrature_is_right():
    """Against the closed form of an integrating sphere, and converged; isotropic, against rays."""
    dome = DOMES["hemispheric"]
    assert dome.diffuse_power("lambertian") == pytest.approx(0.02955493, rel=1e-6)
    assert dome.diffuse_power("isotropic", 18) == pytest.approx(dome.diffuse_power("isotropic", 24), rel=1e-5)
    assert dome.diffuse_power("isotropic", 18) == pytest.approx(0.021851, abs=3 * 8e-6)


@pytest.mark.parametrize(
    ("cell", "law", "cells"),
    [
        ("hemispheric", "lambertian", 1),
        ("hemispheric", "lambertian", 3),
        ("hemispheric", "isotropic", 1),
        ("spherical", "lambertian", 1),
        ("spherical", "isotropic", 3),
    ],
)
def test_diffuse_domes_read_as_the_sphere(llvm_mono, cell, law, cells):
    points = (1 << (11 if law == "lambertian" else 13)) // cells**2
    readings = measure(scene(cell, {"scattering": law}, cells), points=points, seed=4, mechanics_error=False)
    agrees(readings, diffuse_truth(cell, law), 0.0, DIFFUSE)


@pytest.mark.parametrize(
    ("cell", "rms_slope", "cells"),
    [("hemispheric", 0.0, 1), ("hemispheric", 0.0, 3), ("hemispheric", 2.0, 1), ("spherical", 0.0, 1)],
)
def test_mirror_domes_read_as_the_sphere(llvm_mono, cell, rms_slope, cells):
    wall = {"scattering": "rough_mirror", "rms_slope": rms_slope} if rms_slope else {"scattering": "mirror"}
    readings = measure(scene(cell, wall, cells), points=(1 << 11) // cells**2, seed=4, mechanics_error=False)
    truth, error = mirror_truth(cell, rms_slope)
    agrees(readings, truth, error, MIRROR)


@pytest.mark.parametrize(
    ("cell", "wall", "cut"),
    [
        ("hemispheric", {"scattering": "lambertian"}, {"subdivision": 2}),
        ("hemispheric", {"scattering": "lambertian"}, {"subdivision": 4, "mesh_size": 2.5}),
        ("hemispheric", {"scattering": "isotropic"}, {"subdivision": 2}),
        ("hemispheric", {"scattering": "mirror"}, {"subdivision": 3}),
        ("spherical", {"scattering": "lambertian"}, {"subdivision": 2}),
        ("spherical", {"scattering": "isotropic"}, {"subdivision": 1}),
        ("spherical", {"scattering": "mirror"}, {"subdivision": 3, "mesh_size": 2.5}),
    ],
)
def test_the_stated_error_of_the_geometry_covers_that_against_the_sphere(llvm_mono, cell, wall, cut):
    """Cuts so coarse that it stands out of the noise; two standard deviations, and four of the light."""
    law = wall["scattering"]
    truth, error = mirror_truth(cell) if law == "mirror" else (diffuse_truth(cell, law), 0.0)
    readings = measure(scene(cell, wall, **cut), points=1 << 11, seed=7)
    budget = readings.error_budget
    assert readings.deviation is None and budget["mechanics"] == 0 < budget["geometry"] < 0.02
    assert budget["total"] == pytest.approx(math.hypot(budget["light"], budget["geometry"]))
    noise = math.hypot(readings.standard_error[0], error)
    assert abs(readings.power[0] - truth) < 2 * readings.geometry_error[0] + 4 * noise


def test_a_target_refines_an_unloaded_pad(llvm_mono):
    rough = scene("hemispheric", {"scattering": "lambertian"}, subdivision=2)
    plain, aimed = measure(rough, points=64), measure(rough, target_error=0.002, irradiance=True)
    assert plain.error_budget["geometry"] > 0.002 >= aimed.error_budget["total"]
    assert aimed.mesh_size is not None
    truth = DOMES["hemispheric"].diffuse_power("lambertian")
    assert abs(aimed.power[0] - truth) < 3 * aimed.total_error[0]


@pytest.mark.parametrize("cell", ["hemispheric", "spherical", "cylindrical"])
def test_round_mirrors_of_few_triangles_are_refused(llvm_mono, cell):
    """A hemisphere would read 2.5 % too little, and state 0.2 %."""
    walls = {"type": "region", "side": {"type": "wall", "scattering": "mirror"}}
    coarse = scene(cell, {}, subdivision=2)
    coarse.source["pad"]["walls"] = walls
    with pytest.raises(InputError, match="subdivision = 2 is not allowed: the side is a mirror and may be curved"):
        coarse.load()


def test_flat_mirrors_may_have_few_triangles(llvm_mono):
    scene("parallelepiped", {"scattering": "mirror"}, subdivision=1).load()
    scene("cylindrical", {"scattering": "mirror"}, subdivision=1).load()


def test_flat_cells_state_no_error_of_the_geometry(llvm_mono):
    readings = measure(scene("parallelepiped", {"scattering": "lambertian"}), points=64)
    assert readings.error_budget["geometry"] == 0 and not readings.facets.any()


@pytest.mark.parametrize("law", ["lambertian", "mirror"])
def test_a_finer_cut_of_a_pressed_dome_reads_the_same(llvm_mono, law):
    """Facets err with the square of their size: of a cut three times as fine by a ninth."""
    points = 1 << (13 if law == "mirror" else 11)
    here, fine = (
        measure(
            scene("hemispheric", {"scattering": law}, force=[0, 0, -2], **cut),
            points=points,
            seed=seed,
            mechanics_error=False,
        )
        for seed, cut in ((1, {}), (2, {"subdivision": 24}))
    )
    noise = math.hypot(here.standard_error[0], fine.standard_error[0])
    assert noise < 1e-3 * fine.power[0]
    within = MIRROR if law == "mirror" else DIFFUSE
    assert abs(here.power[0] - fine.power[0]) < within * fine.power[0] + 4 * noise


@pytest.mark.parametrize(
    "shares", [{"scattering": "mirror"}, {"scattering": "mixed", "specular": 0.5, "isotropic": 0.5}]
)
def test_curved_mirrors_lose_no_light(llvm_mono, shares):
    """Every side of the cell reflects all: light ends on package and board alone, however often it grazes the dome."""
    whole = scene("hemispheric", shares)
    whole.source["pad"]["walls"] = {"type": "wall", **shares}
    whole.source["board"] = {
        "type": "rectangle",
        "to_world": llvm_mono.ScalarTransform4f().scale(5),
        "bsdf": {"type": "wall", "scattering": "absorbing"},
    }
    audit = energy_audit(whole, points=512)
    shares = dict(zip(audit.places, audit.share, strict=True))
    assert audit.total == pytest.approx(1, abs=1e-9)
    kept = sum(share for place, share in shares.items() if "roof" in place or "side" in place or "escaped" in place)
    assert kept < 2e-5, shares
    assert np.isfinite(audit.share).all()


def narrow(cell, cone, force=-0.3, others=(), **sensor):
    """A cell of a Lambertian roof with a small LED; the sides and ``others`` are black."""
    wall = {"type": "wall", "scattering": "lambertian", "reflectance": 0.9}
    black = {"type": "wall", "reflectance": 0.0}
    pad = {"type": "deformable_pad", "cell": cell, "rows": 1, "columns": 1, "force": [0.0, 0.0, force]}
    led = {"type": "annular_led", "size": 0.05, "hole": 0.0, "law": "uniform_solid_angle", "cone_angle": cone}
    sensor = {"type": "phototransistor", "width": 0.2, "depth": 0.2, **sensor}
    package = {"type": "photo_reflector", "spacing": 0.7, "led": led, "sensor": sensor}
    walls = {"type": "region", "roof": wall, **dict.fromkeys(("side", *others), black)}
    return Scene({"type": "scene", "pad": {**pad, "mesh_size": 2.0, "bsdf": walls}, "package": package})


@pytest.mark.parametrize("force", [0.0, -0.3])
@pytest.mark.parametrize(("cell", "cone"), [("spherical", 0.5), ("spherical", 3.0), ("hemispheric", 1.0)])
def test_a_spot_on_few_triangles_is_off_by_what_is_stated(llvm_mono, cell, cone, force):
    """Against light without random numbers, which knows the curved walls."""
    scene = narrow(cell, cone, force)
    exact, paths = measure(scene), measure(scene, points=512, seed=1)
    assert exact.points == 0
    off = abs(paths.power - exact.power)
    assert np.all(off < 2 * np.hypot(paths.total_error, exact.total_error))


def test_a_narrow_view_of_few_triangles_is_stated_too(llvm_mono):
    def geometry(exponent):
        scene = narrow("spherical", 60.0, response="cosine_power", exponent=exponent)
        readings = measure(scene, points=256, seed=1)
        return readings.error_budget["geometry"]

    assert geometry(3000.0) > 3 * geometry(1.0)


def test_a_region_may_name_walls_that_a_pad_does_not_have(llvm_mono):
    plain, named = (measure(narrow("spherical", 3.0, 0.0, others), points=64, seed=1) for others in ((), ("body",)))
    assert named.geometry_error[0] == plain.geometry_error[0] > 0
