"""Ranges and lists of varied parameters."""

from __future__ import annotations

from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitsuba_taxel import InputError
from mitsuba_taxel.studies.plan.vary import (
    MOST_JOBS,
    checked_places,
    combinations,
    curve_dimension,
    make_axes,
    parse_values,
    sides_along,
)

pytestmark = pytest.mark.quick

DECIMALS = st.decimals(-1000, 1000, allow_nan=False, allow_infinity=False, places=3)


@given(start=DECIMALS, step=DECIMALS.filter(bool), count=st.integers(0, 200))
def test_range_holds_both_ends_and_equal_steps(start: Decimal, step: Decimal, count: int):
    stop = start + count * step
    values = [Decimal(word) for word in parse_values("z", f"{start}:{stop}:{step}")]
    assert values == [start + i * step for i in range(count + 1)] and values[-1] == stop


def test_range_of_the_paper():
    values = parse_values("fz", "0:-20:-0.5")
    assert len(values) == 41 and values[1] == "-0.5" and values[-1] == "-20.0"


def test_lists():
    assert parse_values("cell", "parallelepiped, hemispheric") == ["parallelepiped", "hemispheric"]
    assert parse_values("fz", (0, -1.5)) == ["0", "-1.5"]


@pytest.mark.parametrize(
    "text, complaint",
    [
        ("0:1:0", "endless"),
        ("0:1:-1", "empty"),
        ("0:1:0.3", "do not reach the stop 1"),
        ("0:0", "not a range"),
        ("a:b:c", "not a range"),
        ("0:nan:1", "finite"),
        ("0:1e999:1", "finite"),
        ("0:1:1e-300", str(MOST_JOBS)),
        ("", "blank"),
        ("1,,2", "blank"),
        ("1,2,1.0", "twice"),
        ("@nowhere.txt", "cannot be read"),
    ],
)
def test_refused(text, complaint):
    with pytest.raises(InputError, match=complaint) as refusal:
        make_axes({"fz": text})
    assert "fz" in str(refusal.value)


def test_a_file_holds_a_value_per_line(tmp_path):
    (tmp_path / "forces.txt").write_text("# in N\n0\n-0.5  # first touch\n\n-2\n")
    assert parse_values("fz", "@forces.txt", tmp_path) == ["0", "-0.5", "-2"]


def test_product_runs_fastest_along_the_last():
    jobs = list(combinations(make_axes({"cell": ["a", "b"], "fz": ["0", "-1"]})))
    assert [index for index, _ in jobs] == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert jobs[2][1] == {"cell": "b", "fz": "0"}


def test_values_that_go_together_are_one_dimension():
    jobs = list(combinations(make_axes({"cell": "a,b"}, {"fx": "0:2:1", "fz": "-8,-8,-9"})))
    assert [index for index, _ in jobs] == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]
    assert jobs[5][1] == {"cell": "b", "fx": "2", "fz": "-9"}


@pytest.mark.parametrize(
    "vary, together, complaint",
    [
        ({}, {}, "nothing is varied"),
        ({}, {"fx": "0,1", "fy": "0,1,2"}, "fx has 2, fy has 3"),
        ({"fx": "0,1"}, {"fx": "0,1"}, "fx is varied twice"),
    ],
)
def test_dimensions_refused(vary, together, complaint):
    with pytest.raises(InputError, match=complaint):
        make_axes(vary, together)


def test_product_is_bounded():
    many = [str(i) for i in range(1000)]
    with pytest.raises(InputError, match="1000000000 scenes"):
        make_axes(dict.fromkeys("abc", many))


@pytest.mark.parametrize(
    "varied, together, curve",
    [
        ({"cell": ["a", "b"]}, {}, "cell"),
        ({"cell": ["a", "b"], "z": ["1", "2"]}, {}, "z"),
        ({"z": ["1", "2"], "fz": ["0", "-1"]}, {}, "fz"),
        ({"fz": ["0"], "z": ["1", "2"]}, {}, "z"),
        ({"z": ["1", "2"]}, {"fx": ["0", "1"], "fy": ["0", "1"]}, "step"),
    ],
)
def test_curve_dimension(varied, together, curve):
    assert curve_dimension(make_axes(varied, together)) == curve


@pytest.mark.parametrize(
    "vary, together, places",
    [
        ({"fz": "0:-20:-0.5"}, {}, {0, 10, 20, 30, 40}),
        ({"fz": "0,-1,-2"}, {}, {0, 1, 2}),
        ({"fz": "0,-1,-2,0.5,-3,-4,-5,-6"}, {}, set(range(8))),  # goes back and forth
        ({"cell": "a,b,c,d,e,f,g"}, {}, set(range(7))),
        ({}, {"fx": range(9), "fy": [0] * 9}, {0, 2, 4, 6, 8}),
        ({}, {"fx": range(9), "name": list("abcdefghi")}, set(range(9))),
    ],
)
def test_places_where_the_mechanics_is_checked(vary, together, places):
    (axis,) = make_axes(vary, together)
    assert checked_places(axis) == places


def test_curves_go_on_at_one_side_of_their_ends():
    axes = make_axes({"fx": "0,2,4", "cell": "cylindrical,spherical"}, {"fz": [0, -8], "wall": [1, 1]})
    assert sides_along(axes[0]) == [{"fx": 1}, {"fx": 0}, {"fx": -1}]
    assert sides_along(axes[1]) == [{}, {}]
    assert sides_along(axes[2]) == [{"fz": -1, "wall": 0}, {"fz": 1, "wall": 0}]
