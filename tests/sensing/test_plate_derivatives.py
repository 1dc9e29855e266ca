"""Derivatives in scenes without a pad, by differences of random paths: against quadrature of the plate case.

Z-tests at 4 standard errors: of the 10 comparisons, one fails by chance in 1600 runs.
"""

from __future__ import annotations

import numpy as np
import pytest
from plate_reference import image_power, plate_power

from mitsuba_taxel import InputError, Scene, measure
from mitsuba_taxel.sensing.derivative_values import BY_PATHS


def expected(power, at: dict[str, float], name: str) -> float:
    """Derivative of a quadrature, by differences of fourth order."""
    step = 0.02

    def difference(h: float) -> float:
        return (power(**{**at, name: at[name] + h}) - power(**{**at, name: at[name] - h})) / (2 * h)

    return (4 * difference(step) - difference(2 * step)) / 3


@pytest.mark.parametrize(
    ("law", "scattering", "z", "offset", "names"),
    [
        ("uniform_solid_angle", "mirror", 0.7, 0.0, ("z", "spacing")),
        ("lambertian", "mirror", 0.45, 0.0, ("z", "spacing")),
        ("lambertian", "lambertian", 0.5, 0.0, ("z", "spacing")),
        ("uniform_solid_angle", "isotropic", 0.8, 0.0, ("z", "spacing")),
        ("lambertian", "isotropic", 0.6, 1.8, ("z", "offset_x")),
    ],
)
def test_a_plate_has_the_derivatives_of_its_quadrature(law, scattering, z, offset, names):
    at = {"z": z, "spacing": 0.7}
    if scattering == "mirror":
        power = lambda **where: image_power(law=law, **where)  # noqa: E731
    else:
        at["offset_x"] = offset
        power = lambda offset_x, **where: plate_power(law=law, scattering=scattering, offset=offset_x, **where)  # noqa: E731
    scene = Scene("plate.xml", {**at, "hole": 0, "law": law, "scattering": scattering})
    found = measure(scene, points=1024, seed=3, derivatives=names).derivatives
    truth = np.array([expected(power, at, name) for name in names])
    errors = found.standard_errors[0]
    assert np.all(errors < 0.08 * np.abs(truth))
    assert np.all(np.abs(found.values[0] - truth) < 4 * errors), (found.values[0], truth, errors)
    assert found.method == BY_PATHS and found.units == ("W/mm", "W/mm") and np.isnan(found.strain)


def test_what_changes_nothing_has_no_slope_and_what_is_no_number_none():
    scene = Scene("plate.xml", {"width": 50})
    found = measure(scene, points=64, derivatives=("width",)).derivatives
    assert max(abs(found.values[0, 0]), found.standard_errors[0, 0]) < 1e-15  # W/mm: rounding at most
    with pytest.raises(InputError, match=r"^law = 'uniform_solid_angle' has no derivative: it is not a number"):
        measure(scene, points=64, derivatives=("law",))
    with pytest.raises(InputError, match=r"^fz has no derivative: it is no number of the scene"):
        measure(scene, points=64, derivatives=("fz",))
