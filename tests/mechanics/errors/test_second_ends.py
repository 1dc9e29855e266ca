"""Ends of load paths: their errors from second meshes, and ends that are no limit of the sensor."""

import pickle
import re

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics import load_path
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds, amount
from mitsuba_taxel.mechanics.elements.loads import PlateWrench, Pressure
from mitsuba_taxel.mechanics.errors import second_ends
from mitsuba_taxel.mechanics.errors.second_ends import NO_LIMIT, end_error, furthest_value
from mitsuba_taxel.mechanics.materials.laws import NeoHookean
from mitsuba_taxel.pads.parametric.pad import Pad

REFERENCE = -16.70
"""Normal force in N at which one parallelepiped cell buckles, on elements of 0.625 mm (`taxel bench stability`)."""


def end(cell, force, mesh_size=1.25):
    with pytest.raises(ComputationError) as caught:
        load_path(Pad(cell, rows=1, columns=1), NeoHookean(), [force], mesh_size=mesh_size)
    return caught.value


@pytest.mark.parametrize("ratio", [2.0, 1.5, 0.5])
@pytest.mark.parametrize("slope", [0.3, -0.2])
def test_error_of_an_end_that_is_linear_in_the_element_size(ratio, slope):
    """The load at the end is 10 N + slope h; the error on elements of h = 1 mm is the slope."""
    exact, here, there = (np.array([10.0 + slope * h, 0.0, 1e-9]) for h in (0.0, 1.0, ratio))
    error = end_error(here, there, ratio) * max(here[0], there[0])
    assert error == pytest.approx(abs(here[0] - exact[0]), rel=1e-9)


def test_error_of_the_load_at_which_a_cell_buckles_contains_that_of_finer_elements():
    message = str(end("parallelepiped", (0, 0, -30.0)))
    reached, share = re.search(r"force = \(0, 0, (\S+)\) N\..* is known to about (\d+)%\.$", message).groups()
    error = abs(float(reached)) * float(share) / 100
    assert abs(float(reached) - REFERENCE) <= error <= 0.1 * abs(float(reached))


def test_a_touch_of_sharp_edges_is_no_limit_of_the_sensor():
    """Under a force along x, the end falls from 3.15 to 2.89 and 2.77 N on elements of 2, 1.25 and 0.8 mm."""
    message = str(end("parallelepiped", (8.0, 0, -8 / 9)))
    assert "touches itself" in message and "With self_contact = true the path continues." in message
    assert re.search(rf"On elements of 2\.5 mm it ends at \(3\.\d+, 0, -0\.8889\) N: {NO_LIMIT}\.$", message)


def test_other_elements_are_solved_when_the_message_is_first_read():
    calls = []

    def compared():
        calls.append(1)
        return " Compared."

    end = LoadPathEnds("It ends.", None, np.ones(3), None, compared)
    assert not calls
    assert str(pickle.loads(pickle.dumps(end))) == str(end) == "It ends. Compared." and len(calls) == 1


@pytest.mark.parametrize("beyond", [1.001, 1.02])
def test_the_error_of_an_end_does_not_depend_on_the_requested_load(beyond):
    """A load just beyond the end is borne on the second mesh, whose path is then solved further."""
    far = end("parallelepiped", (0, 0, -30.0))
    near = end("parallelepiped", (0, 0, beyond * far.value[2]))
    assert str(near) == str(far) and "is known to about" in str(far)


@pytest.mark.parametrize("ratio", [2.0, 1.4, 0.5])
@pytest.mark.parametrize(
    ("value", "last"),
    [
        ((0, 0, -9.0), (0, 0, -8.9)),
        ((3, 0, -9.0), (0, 0, -8.9)),
        ((3, 4, -9.0), (2.9, 3.87, -9.0)),
        ((-0.2,), (-0.19,)),
    ],
)
def test_the_second_path_is_solved_until_the_end_would_be_unknown(value, last, ratio):
    value, last = np.array(value, dtype=float), np.array(last)
    furthest = furthest_value(value, last, ratio)
    assert end_error(last, furthest, ratio) > 0.1
    assert np.linalg.norm(furthest) <= 1.25 * np.linalg.norm(last)


def test_the_second_path_stays_on_the_straight_part_with_the_end_and_reaches_the_requested_load():
    assert np.array_equal(furthest_value(np.array([3.0, 0, -20]), np.array([0.0, 0, -9]), 2.0), [0, 0, -20])
    assert np.array_equal(furthest_value(np.array([30.0, 0, -9]), np.array([2.0, 0, -9]), 2.0), [30, 0, -9])
    assert np.array_equal(furthest_value(np.array([30.0, 0, -9]), np.array([0.0, 0, -9]), 2.0), [30, 0, -9])


@pytest.mark.parametrize(
    ("load", "value", "words"),
    [
        (Pressure(), (-0.05,), "-0.05 MPa"),
        (PlateWrench(), (1.0, 0, -2, 0, 3, 0), "(1, 0, -2) N and moment = (0, 3, 0) N mm"),
    ],
)
def test_amounts_have_the_units_of_their_loads(load, value, words):
    assert amount(load, np.array(value)) == words


@pytest.mark.parametrize("failure", [ComputationError, InputError])
def test_an_end_whose_comparison_fails_keeps_its_message(failure):
    def compared():
        raise failure("the undeformed pad touches a package")

    end = LoadPathEnds("It ends.", None, np.ones(3), None, compared)
    assert str(end) == str(pickle.loads(pickle.dumps(end))) == "It ends."


def test_load_path_solves_no_other_elements_before_the_message_is_read(monkeypatch):
    asked, known = [], second_ends.second_meshes
    monkeypatch.setattr(second_ends, "second_meshes", lambda path: asked.append(path) or known(path))
    error = end("parallelepiped", (8.0, 0, -8 / 9), 2.0)
    assert not asked
    assert "On elements of" in str(error) and len(asked) == 1
