"""Creep and relaxation as measures of time: against differential equations and quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from mitsuba_taxel.mechanics.materials.creep import CreepResponse, Growth

SERIES = {
    "one": ((0.6, 2.0),),
    "two": ((0.2, 1.0), (0.3, 10.0)),
    "equal times": ((0.2, 1.0), (0.3, 1.0), (0.1, 5.0)),
    "near 1": ((0.9, 0.5), (0.0999, 40.0)),
}


def by_equations(prony, rates, lengths):
    """Strain by a load of piecewise constant rates, by the equations of the terms: stress = load."""
    shares, times = np.array(prony).T

    def change(_, y, rate):
        speed = rate + (y[1:] / times).sum()
        return np.append(speed, shares * speed - y[1:] / times)

    y, found = np.zeros(1 + len(shares)), []
    for rate, length in zip(rates, lengths, strict=True):
        y = solve_ivp(change, (0, length), y, args=(rate,), rtol=1e-11, atol=1e-13, method="LSODA").y[:, -1]
        found.append(y[0])
    return np.array(found)


@pytest.mark.parametrize("prony", SERIES.values(), ids=SERIES)
def test_creep_is_the_solution_of_the_equations_of_the_terms(prony):
    response = CreepResponse.of(prony, True)
    assert response.lasting + response.amplitudes.sum() == pytest.approx(1, abs=1e-9 * response.lasting)
    memory, at, total = response.at_rest(1), 0.0, []
    rates, lengths = [0.5, -0.2, 0.0], [3.0, 4.0, 20.0]
    for rate, length in zip(rates, lengths, strict=True):
        memory = response.after(memory, np.array([rate * length]), length)
        at += rate * length
        total.append(float(response.lasting * at + response.amplitudes @ memory[:, 0]))
    np.testing.assert_allclose(total, by_equations(prony, rates, lengths), rtol=1e-6)


def test_the_measure_of_a_step_is_the_share_of_its_response():
    prony, memory, rate = SERIES["two"], np.array([[0.3], [0.8]]), np.array([-2.0])
    for creeps in (True, False):
        response, length = CreepResponse.of(prony, creeps), 7.0
        measures = response.measures(memory, rate, length)
        course, even = (measures.main, measures.second) if creeps else (measures.second, measures.main)
        np.testing.assert_allclose(even.at(np.array([0.0, 3.5, 7.0])), [0, 0.5, 1], atol=1e-15)

        def strain(time, response=response):
            after = response.after(memory, rate * time, time)
            return response.lasting * rate[0] * time + response.amplitudes @ after[:, 0]

        start = response.amplitudes @ memory[:, 0]
        for time in (0.1, 2.0, 6.9):
            assert course.at(time) == pytest.approx((strain(time) - start) / (strain(length) - start), rel=1e-12)
    assert measures.main.time_at(0.5) == pytest.approx(3.5)
    held = CreepResponse.of(prony, True).measures(memory, 0 * rate, 1e9)
    assert held.second is None and held.main.at(held.main.time_at(0.5)) == pytest.approx(0.5) and held.main.ends


def test_a_response_that_turns_is_no_measure():
    memory = np.array([[-3.0], [8.0]])
    turning = CreepResponse.of(SERIES["two"], True).measures(memory, np.array([-0.4]), 30.0)
    np.testing.assert_array_equal(turning.main.amplitudes, [])


@pytest.mark.parametrize("length", [1e-6, 0.3, 7.0, 400.0])
def test_moments_are_integrals_over_a_step(length):
    times = np.array([1.0, 10.0])
    course = CreepResponse.of(SERIES["two"], True).measures(np.array([[0.3], [0.8]]), np.array([-2.0]), length).main
    part = course.until(0.4 * length)
    assert part.at(0.2 * length) == pytest.approx(course.at(0.2 * length) / course.at(0.4 * length))
    for each, until in ((course, length), (part, 0.4 * length), (Growth.even(length), length)):
        for tau, found in zip(times, each.moments(times), strict=True):
            for power in (1, 2, 3):

                def gain(s, tau=tau, power=power, each=each, until=until):
                    left = np.exp(-(until - s) / tau)
                    return left * power * each.at(s) ** (power - 1) * each.rate(s)

                pieces = np.append(until - until * 0.5 ** np.arange(12), until)
                exact = sum(quad(gain, a, b, epsabs=1e-14)[0] for a, b in zip(pieces, pieces[1:], strict=False))
                assert found[power - 1] == pytest.approx(exact, rel=1e-9)


def test_moments_at_the_extremes_are_finite():
    times = np.array([1e-6, 1.0, 1e6])
    for length in (1e-9, 1.0, 1e9, 1e300):
        moments = Growth.even(length).moments(times)
        assert np.all((moments >= 0) & (moments <= 1 + 1e-12))


def test_a_bump_is_1_midway_and_flat_at_both_ends():
    memory, rate = np.array([[0.0], [0.0]]), np.array([1.0])
    for measures in (
        CreepResponse.of(SERIES["two"], True).measures(memory, rate, 20.0),
        CreepResponse.of(SERIES["two"], False).measures(memory, rate, 20.0),
        CreepResponse.of(SERIES["two"], True).measures(memory + 1, 0 * rate, 20.0),
    ):
        middle, end = measures.main.time_at(0.5), 20.0
        assert measures.bump(middle)[0] == pytest.approx(1)
        np.testing.assert_allclose([measures.bump(0.0), measures.bump(end)], 0, atol=1e-9)
        difference = (measures.bump(3.001)[0] - measures.bump(2.999)[0]) / 0.002
        assert measures.bump(3.0)[1] == pytest.approx(difference, rel=1e-5)
