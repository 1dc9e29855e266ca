"""Tables of current over distance: units, and rows that are no curve."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.fitting.part.distances import read_distances

pytestmark = pytest.mark.quick

ROWS = ((0.5, 0.4), (1.0, 0.8), (1.5, 0.6), (2.0, 0.4), (3.0, 0.2))


def written(folder, head="distance [mm],current [mA]", rows=ROWS):
    file = folder / "curve.csv"
    file.write_text(head + "\n" + "".join(f"{','.join(map(str, row))}\n" for row in rows))
    return file


@pytest.mark.parametrize(
    ("head", "scale"),
    [
        ("distance [mm],current [mA]", 1), ("height [um],current", 1e-3), ("z (cm),reading [V]", 10),
        ("gap_mm,counts [adc]", 1),
    ],
)  # fmt: skip
def test_units(tmp_path, head, scale):
    curve = read_distances(written(tmp_path, head), zero=0.25)
    heights, currents = np.array(ROWS).T
    np.testing.assert_allclose(curve.heights, heights * scale + 0.25)
    np.testing.assert_allclose(curve.currents, currents / 0.8)


def test_columns_may_change_places(tmp_path):
    swapped = read_distances(written(tmp_path, "current [uA],distance [mm]", [row[::-1] for row in ROWS]))
    np.testing.assert_allclose(swapped.heights, np.array(ROWS)[:, 0])


@pytest.mark.parametrize(
    ("head", "rows", "said"),
    [
        (None, ROWS[:1], "has 1 rows: at least 5 are needed"),
        (None, (*ROWS, (2.5, 0.3)), "line 7: the distance falls from 3 to 2.5 mm"),
        (None, (*ROWS, (4.0, -0.1)), "line 7: the current -0.1 is negative"),
        (None, ((0.0, 0.1), *ROWS), "line 2: the reflector is 0 mm above the windows"),
        (None, ((-1.0, 0.1), *ROWS), "line 2: the reflector is -1 mm above the windows"),
        (None, [(z, 0) for z, _ in ROWS], "has no current above 0"),
        (None, [(1.0, i) for _, i in ROWS], "has one distance only"),
        (None, [(z, "high") for z, _ in ROWS], "line 2, column current .*: 'high' is not allowed: a number"),
        ("distance,current [mA]", ROWS, "exactly one must have a unit of length"),
        ("distance [mm],current [mm]", ROWS, "exactly one must have a unit of length"),
        ("distance [N],current [mA]", ROWS, "exactly one must have a unit of length"),
        ("distance [mm],current [N]", ROWS, "the unit N of column .* is not allowed: A, V, W, counts"),
        ("distance [mm],current [mA],x", [(*row, 1) for row in ROWS], "has 3 columns"),
    ],
)
def test_what_is_no_curve_is_refused_in_one_line(tmp_path, head, rows, said):
    file = written(tmp_path, rows=rows) if head is None else written(tmp_path, head, rows)
    with pytest.raises(InputError, match=said) as refused:
        read_distances(file)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("zero", [-1.0, float("nan"), "1"])
def test_no_zero(tmp_path, zero):
    with pytest.raises(InputError, match="zero = "):
        read_distances(written(tmp_path), zero)
