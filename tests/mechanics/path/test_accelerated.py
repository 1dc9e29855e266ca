"""Accelerated iterations, against direct solutions."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.mechanics.path.accelerated import accelerated
from mitsuba_taxel.mechanics.path.solution import Rejected

SIZE, DISPLACEMENTS = 60, 45


@pytest.mark.parametrize("outliers", [(), (0.1, 0.2), (0.3, 0.5, 1.7)])
def test_few_slow_components_take_few_iterations(outliers):
    """Corrections that leave a tenth of most components, but nearly all of few."""
    rng = np.random.default_rng(3)
    kept = 1 + 0.1 * rng.uniform(-1, 1, SIZE)
    kept[: len(outliers)] = outliers
    basis = np.linalg.qr(rng.standard_normal((SIZE, SIZE)))[0]
    applied, wanted = (basis * kept) @ basis.T, rng.standard_normal(SIZE)
    found, iterations = accelerated(np.zeros(SIZE), lambda x: applied @ (x - wanted), DISPLACEMENTS, 1e-5)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-4)
    assert iterations <= 9  # where those alone take more than fifty


def test_a_curved_problem():
    wanted = np.linspace(-1, 1, SIZE)
    found, _ = accelerated(np.zeros(SIZE), lambda x: np.sinh(x) - np.sinh(wanted), SIZE, 1e-7)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-6)


@pytest.mark.parametrize("correct", [lambda x: None, lambda x: 3 * (x - 1) + 5 * x**3, lambda x: np.ones_like(x)])
def test_what_leads_no_closer_is_rejected(correct):
    with pytest.raises(Rejected):
        accelerated(np.linspace(2, 3, SIZE), correct, DISPLACEMENTS, 1e-5)
