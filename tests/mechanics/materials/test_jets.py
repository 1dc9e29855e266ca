"""Second-order differentiation against closed forms and differences."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.mechanics.materials.jets import Jet

X, Y = np.array([0.4, 1.3, 2.1]), np.array([0.9, 0.2, 1.7])
PARTS = ("value", "d1", "d2", "d11", "d12", "d22")

# f, and its value, d/dx, d/dy, d2/dx2, d2/dxdy, d2/dy2
CLOSED_FORMS = {
    "sum": (lambda x, y: 2 + x - 3 * y - 1 + (-y), lambda x, y: (1 + x - 4 * y, 1, -4, 0, 0, 0)),
    "reversed": (lambda x, y: 5 - x / 2 + 1 * y, lambda x, y: (5 - x / 2 + y, -0.5, 1, 0, 0, 0)),
    "product": (lambda x, y: x**3 * y, lambda x, y: (x**3 * y, 3 * x**2 * y, x**3, 6 * x * y, 3 * x**2, 0)),
    "quotient": (lambda x, y: x / y, lambda x, y: (x / y, 1 / y, -x / y**2, 0, -1 / y**2, 2 * x / y**3)),
    "inverse": (lambda x, y: 2 / x, lambda x, y: (2 / x, -2 / x**2, 0, 4 / x**3, 0, 0)),
    "exponential": (
        lambda x, y: np.exp(x * y),
        lambda x, y: np.exp(x * y) * np.array([np.ones(3), y, x, y**2, 1 + x * y, x**2]),
    ),
    "logarithm": (
        lambda x, y: np.log(x + 2 * y),
        lambda x, y: (
            np.log(x + 2 * y),
            1 / (x + 2 * y),
            2 / (x + 2 * y),
            -1 / (x + 2 * y) ** 2,
            -2 / (x + 2 * y) ** 2,
            -4 / (x + 2 * y) ** 2,
        ),
    ),
    "root": (lambda x, y: np.sqrt(y), lambda x, y: (y**0.5, 0, 0.5 * y**-0.5, 0, 0, -0.25 * y**-1.5)),
    "square": (lambda x, y: np.square(x), lambda x, y: (x**2, 2 * x, 0, 2, 0, 0)),
    "power of a number": (
        lambda x, y: 2.0**x,
        lambda x, y: (2**x, np.log(2) * 2**x, 0, np.log(2) ** 2 * 2**x, 0, 0),
    ),
    "power of a jet": (
        lambda x, y: x**y,
        lambda x, y: (
            x**y,
            y * x ** (y - 1),
            np.log(x) * x**y,
            y * (y - 1) * x ** (y - 2),
            x ** (y - 1) * (1 + y * np.log(x)),
            np.log(x) ** 2 * x**y,
        ),
    ),
}


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_derivatives_are_the_closed_forms(name):
    function, closed_form = CLOSED_FORMS[name]
    jet = function(Jet(X, d1=1.0), Jet(Y, d2=1.0))
    for part, expected in zip(PARTS, closed_form(X, Y), strict=True):
        found = getattr(jet, part)
        np.testing.assert_allclose(0 if found is None else found, expected, rtol=1e-13, err_msg=part)


def composite(x, y):
    return np.sqrt(1 + x * y**2) / (2 + np.log(x + y)) - 0.3 * np.exp(-x) ** y + (x - y) ** 3


def test_derivatives_of_a_composite_function_are_its_differences():
    jet = composite(Jet(X, d1=1.0), Jet(Y, d2=1.0))
    h = 1e-4

    def shifted(i, j):
        return composite(X + i * h, Y + j * h)

    np.testing.assert_allclose(jet.value, composite(X, Y), rtol=1e-14)
    np.testing.assert_allclose(jet.d1, (shifted(1, 0) - shifted(-1, 0)) / (2 * h), rtol=1e-6)
    np.testing.assert_allclose(jet.d2, (shifted(0, 1) - shifted(0, -1)) / (2 * h), rtol=1e-6)
    np.testing.assert_allclose(jet.d11, (shifted(1, 0) - 2 * jet.value + shifted(-1, 0)) / h**2, rtol=1e-5)
    np.testing.assert_allclose(jet.d22, (shifted(0, 1) - 2 * jet.value + shifted(0, -1)) / h**2, rtol=1e-5)
    mixed = shifted(1, 1) - shifted(1, -1) - shifted(-1, 1) + shifted(-1, -1)
    np.testing.assert_allclose(jet.d12, mixed / (4 * h**2), rtol=1e-5)


@pytest.mark.parametrize("factor", [np.float64(2.0), np.array([2.0, 3.0, 4.0])], ids=["number", "array"])
def test_numbers_and_arrays_of_numpy_leave_the_jet_a_jet(factor):
    x = Jet(X, d1=1.0)
    for jet in (factor * x, x * factor, factor + x, x + factor, factor - x, factor / x, factor**x):
        assert isinstance(jet, Jet)
    np.testing.assert_allclose((factor * x).d1, factor)
    np.testing.assert_allclose((factor - x).value, factor - X)
    np.testing.assert_allclose((factor / x).d1, -factor / X**2)
    np.testing.assert_allclose((factor**x).d1, np.log(factor) * factor**X)


def test_what_is_always_zero_is_never_computed():
    x, y = Jet(X, d1=1.0), Jet(Y, d2=1.0)
    linear = 0.5 * (x - 3) + 2
    assert linear.d1 == 0.5
    assert linear.d2 is linear.d11 is linear.d12 is linear.d22 is None
    cubic = np.exp(x) + x**3
    assert cubic.d2 is cubic.d12 is cubic.d22 is None
    bilinear = x * y
    assert bilinear.d11 is bilinear.d22 is None
    assert bilinear.d12 == 1.0


@pytest.mark.parametrize("exponent", [0, 1, 2, 3])
def test_whole_powers_are_defined_at_zero(exponent):
    jet = Jet(0.0, d1=1.0) ** exponent
    assert jet.value == 0.0**exponent
    assert (jet.d1 or 0.0) == (1.0 if exponent == 1 else 0.0)
    assert (jet.d11 or 0.0) == (2.0 if exponent == 2 else 0.0)


def test_a_function_that_is_not_known_is_refused():
    with pytest.raises(TypeError):
        np.arctan(Jet(X, d1=1.0))
