"""Laws of emission: what they sample, against the densities that they state."""

from __future__ import annotations

import numpy as np
import pytest
from chi_square import SIGNIFICANCE, chi2
from kernel_arrays import vectors

from mitsuba_taxel import AnnularLed

pytestmark = pytest.mark.quick


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
    from mitsuba.chi2 import SphericalDomain

    from mitsuba_taxel.kernels.taxels.emission import law_of

    given = dict(parameters)
    if "table" in given:
        (tmp_path / "led.csv").write_text(given.pop("table"))
        given["file"] = str(tmp_path / "led.csv")
    law = law_of(AnnularLed(law=law, **given))
    chi2(SphericalDomain(), law.sample, law.density)


@pytest.mark.parametrize("cone_angle", [20.0, 88.0])
def test_uniform_polar_angle(llvm_mono, cone_angle):
    """Its density has a pole on the axis, so the polar angle itself is tested: it must be uniform."""
    mi = llvm_mono
    from scipy import stats

    from mitsuba_taxel.kernels.taxels.emission import UniformPolarAngle

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
    from mitsuba_taxel.kernels.taxels.emission import law_of

    nodes, weights = np.polynomial.legendre.leggauss(400)
    limit = np.pi / 2 if law == "lambertian" else np.radians(88)
    theta = 0.5 * limit * (nodes + 1)
    directions = vectors(mi, np.sin(theta), 0, np.cos(theta))
    density = law_of(AnnularLed(law=law)).density(directions).numpy().astype(float)
    assert 0.5 * limit * weights @ (2 * np.pi * np.sin(theta) * density) == pytest.approx(1, abs=1e-5)
