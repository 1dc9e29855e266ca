"""Light in cells with rounded edges."""

import numpy as np
import pytest

from mitsuba_taxel import Pad, PadSensor, measure

REST = (0.0, 0.0, 0.0)


def reading(pad, **arguments):
    return measure(PadSensor(pad, force=REST).scene(), mechanics_error=False, **arguments)


@pytest.mark.parametrize("cell", ["parallelepiped", "cylindrical"])
def test_light_of_small_fillets_converges_to_that_of_sharp_edges(cell):
    sharp, small, wide = (reading(Pad(cell, rows=1, columns=1, fillet=f)).power[0] for f in (0.0, 0.04, 0.08))
    assert small < 0.99 * sharp
    assert 2 * small - wide == pytest.approx(sharp, rel=2e-3)


@pytest.mark.parametrize("cell", ["parallelepiped", "cylindrical"])
def test_the_derivative_by_the_radius_is_that_of_moved_pads(cell):
    pad, step = Pad(cell, rows=1, columns=1, fillet=0.2), 2e-3
    derivatives = reading(pad, derivatives=("fillet",)).derivatives
    ends = [reading(pad.changed(fillet=0.2 + sign * step).moved_from(pad)).power[0] for sign in (1, -1)]
    rate = (ends[0] - ends[1]) / (2 * step)
    tolerance = 5 * float(np.ravel(derivatives.standard_errors)[0]) + 0.01 * abs(rate)
    assert float(np.ravel(derivatives.values)[0]) == pytest.approx(rate, abs=tolerance)
