"""What the plugins sample, against the densities that they state."""

from __future__ import annotations

import math

import numpy as np
import pytest
from kernel_arrays import floats, vectors

from mitsuba_taxel import AnnularLed

SIGNIFICANCE = 1e-4


def chi2(mi, domain, sample, density, dimensions=2, samples=400_000, resolution=61):
    """Run Mitsuba's chi-square test; it may fail with probability :data:`SIGNIFICANCE` although all is well."""
    from mitsuba.chi2 import ChiSquareTest

    test = ChiSquareTest(
        domain=domain,
        sample_func=sample,
        pdf_func=density,
        sample_dim=dimensions,
        sample_count=samples,
        res=resolution,
        ires=16,
    )
    assert test.run(SIGNIFICANCE, quiet=True), test.messages


@pytest.mark.parametrize(
    "law, parameters",
    [
        ("uniform_solid_angle", {"cone_angle": 20.0}),
        ("uniform_solid_angle", {"cone_angle": 88.0}),
        ("lambertian", {}),
        ("cosine_power", {"exponent": 0.0}),
        ("cosine_power", {"exponent": 0.5}),
        ("cosine_power", {"exponent": 30.0}),
        ("tabulated", {"table": "0,1\n20,0.9\n30,0.6\n50,0.1\n90,0\n"}),
        ("tabulated", {"table": "0,0.2\n40,1\n70,0\n80,0.1\n"}),
    ],
)
def test_emission_law(llvm_mono, tmp_path, law, parameters):
    mi = llvm_mono
    from mitsuba.chi2 import SphericalDomain

    from mitsuba_taxel.kernels.emission import law_of

    given = dict(parameters)
    if "table" in given:
        (tmp_path / "led.csv").write_text(given.pop("table"))
        given["file"] = str(tmp_path / "led.csv")
    law = law_of(AnnularLed(law=law, **given))
    chi2(mi, SphericalDomain(), law.sample, law.density)


@pytest.mark.parametrize("cone_angle", [20.0, 88.0])
def test_uniform_polar_angle(llvm_mono, cone_angle):
    """Its density has a pole on the axis, so the polar angle itself is tested: it must be uniform."""
    mi = llvm_mono
    from scipy import stats

    from mitsuba_taxel.kernels.emission import UniformPolarAngle

    law = UniformPolarAngle(cone_angle)
    sample = mi.PCG32(size=100_000)
    d = law.sample(mi.Point2f(sample.next_float32(), sample.next_float32()))
    x, y, z = (component.numpy().astype(float) for component in d)
    theta = np.degrees(np.arctan2(np.hypot(x, y), z))
    phi = np.arctan2(y, x)
    assert stats.kstest(theta / cone_angle, "uniform").pvalue > SIGNIFICANCE
    assert stats.kstest(phi / (2 * np.pi) + 0.5, "uniform").pvalue > SIGNIFICANCE
    off_axis = theta > 0.1
    expected = 1 / (2 * np.pi * np.radians(cone_angle) * np.sin(np.radians(theta[off_axis])))
    assert np.allclose(law.density(d).numpy()[off_axis], expected, rtol=2e-3)


@pytest.mark.parametrize("law", ["uniform_solid_angle", "uniform_polar_angle", "lambertian"])
def test_emission_laws_integrate_to_one(llvm_mono, law):
    mi = llvm_mono
    from mitsuba_taxel.kernels.emission import law_of

    nodes, weights = np.polynomial.legendre.leggauss(400)
    limit = np.pi / 2 if law == "lambertian" else np.radians(88)
    theta = 0.5 * limit * (nodes + 1)
    directions = vectors(mi, np.sin(theta), 0, np.cos(theta))
    density = law_of(AnnularLed(law=law)).density(directions).numpy().astype(float)
    assert 0.5 * limit * weights @ (2 * np.pi * np.sin(theta) * density) == pytest.approx(1, abs=1e-5)


def led_on_rectangle(mi, **parameters):
    """An LED on a 2 x 2 rectangle that is turned and displaced."""
    turn = mi.ScalarTransform4f().translate([0.3, -0.2, 0.7]).rotate([0.6, 0.8, 0], 50)
    scene = mi.load_dict(
        {
            "type": "scene",
            "r": {"type": "rectangle", "to_world": turn, "led": {"type": "annular_led", **parameters}},
        }
    )
    return scene, scene.emitters()[0]


@pytest.mark.parametrize("hole", [0.0, 0.1, 0.2])
def test_led_lights_its_annulus_uniformly(llvm_mono, hole):
    mi = llvm_mono
    from mitsuba.chi2 import PlanarDomain

    _, led = led_on_rectangle(mi, size=0.25, hole=hole)

    def offset(sample):
        ps, _ = led.sample_position(0, sample)
        return led.faces.locate(ps.p)[1]

    def density(p):
        half = floats(mi, np.maximum(np.abs(p.x.numpy()), np.abs(p.y.numpy())))
        inside = (half <= 0.125) & (half >= 0.5 * hole)
        import drjit as dr

        return dr.select(inside, 1 / (0.25**2 - hole**2), 0)

    domain = PlanarDomain(mi.ScalarBoundingBox2f([-0.125, -0.125], [0.125, 0.125]))
    chi2(mi, domain, offset, density, resolution=50)


@pytest.mark.parametrize("law", ["uniform_solid_angle", "uniform_polar_angle", "lambertian", "cosine_power"])
@pytest.mark.parametrize("strategy, power", [("unidirectional_hits", 1.0), ("unidirectional_hits", 0.25), ("all", 1.0)])
def test_led_emits_its_power(llvm_mono, agree, law, strategy, power):
    """A phototransistor that all but covers the sky of the LED receives all of it."""
    from mitsuba_taxel import Scene, measure

    mi = llvm_mono
    down = mi.ScalarTransform4f().translate([0, 0, 0.01]).rotate([1, 0, 0], 180).scale(200)
    scene = Scene(
        {
            "type": "scene",
            "integrator": {"type": "taxel_tracer", "strategy": strategy},
            "below": {"type": "rectangle", "led": {"type": "annular_led", "power": power, "law": law}},
            "above": {
                "type": "rectangle",
                "to_world": down,
                "sensor": {"type": "phototransistor", "width": 400, "depth": 400},
            },
        }
    )
    reading = measure(scene, points=4096)
    if strategy == "unidirectional_hits":
        assert reading.power[0] == pytest.approx(power, rel=1e-6)
    else:
        agree(reading.power, reading.standard_error, power)


def bsdf_domain(mi, scattering, mode, reflectance=0.7):
    from mitsuba.chi2 import SphericalDomain

    bsdf = mi.load_dict({"type": "wall", "scattering": scattering, "reflectance": reflectance})
    return SphericalDomain(), bsdf, mi.BSDFContext(mode)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("mode", ["Radiance", "Importance"])
@pytest.mark.parametrize("scattering", ["lambertian", "isotropic"])
@pytest.mark.parametrize("angle", [10.0, 75.0])
def test_wall_sampling(llvm_mono, scattering, mode, side, angle):
    """Directions follow the density, the weight is value over density, and both modes are each other's adjoint."""
    import drjit as dr

    mi = llvm_mono
    domain, bsdf, context = bsdf_domain(mi, scattering, getattr(mi.TransportMode, mode))

    def interaction(size):
        si = dr.zeros(mi.SurfaceInteraction3f, size)
        si.wi = mi.Vector3f(math.sin(math.radians(angle)), 0, side * math.cos(math.radians(angle)))
        si.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
        return si

    def sample(sample):
        return bsdf.sample(context, interaction(dr.width(sample)), 0.5, sample)[0].wo

    chi2(mi, domain, sample, lambda wo: bsdf.pdf(context, interaction(dr.width(wo)), wo))

    rng = mi.PCG32(size=10_000)
    si = interaction(10_000)
    bs, weight = bsdf.sample(context, si, 0.5, mi.Point2f(rng.next_float32(), rng.next_float32()))
    value, density = bsdf.eval_pdf(context, si, bs.wo)
    assert np.allclose(bs.pdf.numpy(), density.numpy(), rtol=1e-5)
    assert np.allclose((weight[0] * density).numpy(), value[0].numpy(), rtol=1e-4)


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic"])
def test_wall_transport_modes_are_adjoint(llvm_mono, scattering):
    """f(wi -> wo) seen from the light equals f(wo -> wi) seen from the detector, cosines apart."""
    import drjit as dr

    mi = llvm_mono
    _, bsdf, light = bsdf_domain(mi, scattering, mi.TransportMode.Importance)
    detector = mi.BSDFContext(mi.TransportMode.Radiance)
    rng = mi.PCG32(size=1000)
    directions = [
        mi.warp.square_to_uniform_hemisphere(mi.Point2f(rng.next_float32(), rng.next_float32())) for _ in range(2)
    ]
    forward, backward = dr.zeros(mi.SurfaceInteraction3f, 1000), dr.zeros(mi.SurfaceInteraction3f, 1000)
    forward.wi, backward.wi = directions
    from_light = bsdf.eval(light, forward, directions[1])[0] / directions[1].z
    from_detector = bsdf.eval(detector, backward, directions[0])[0] / directions[0].z
    assert from_light.numpy() == pytest.approx(from_detector.numpy(), rel=1e-4)


@pytest.mark.parametrize(
    "scattering, albedo", [("lambertian", 0.7), ("isotropic", 0.7), ("mirror", 0.7), ("absorbing", 0)]
)
def test_wall_reflects_its_reflectance(llvm_mono, scattering, albedo):
    import drjit as dr

    mi = llvm_mono
    parameters = {} if scattering == "absorbing" else {"reflectance": albedo}
    bsdf = mi.load_dict({"type": "wall", "scattering": scattering, **parameters})
    si = dr.zeros(mi.SurfaceInteraction3f, 1000)
    si.wi = dr.normalize(mi.Vector3f(0.5, 0.1, 0.3))
    rng = mi.PCG32(size=1000)
    _, weight = bsdf.sample(
        mi.BSDFContext(mi.TransportMode.Importance),
        si,
        0.5,
        mi.Point2f(rng.next_float32(), rng.next_float32()),
    )
    assert np.allclose(weight[0].numpy(), albedo)
