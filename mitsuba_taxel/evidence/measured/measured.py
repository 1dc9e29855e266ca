"""Published measurements of real sensors.

The pad has 5 x 5 photo-reflectors NJL5908AR, and was pressed by a robot. It was made by the authors of the paper
(Vanvitelli Robotics, project REMODEL, public repository of the sensor). The tables of the paper are in `paper`.
"""

from __future__ import annotations

from typing import NamedTuple

REST_VOLTAGE, HELD_SHARE = 1.68, 0.173
"""Mean voltage of 25 taxels at rest, in V; change of taxel 13 while it is held, relative to its voltage at rest."""
REST_SPREAD, REST_VOLTAGES = 18.0, (0.84, 2.04)
"""Spread of the voltages of the 25 taxels at rest: standard deviation in percent of their mean; lowest and highest, in
V."""
LOAD_RESISTANCE, ADC_REFERENCE, ADC_BITS = 22e3, 3.3, 12
"""Load resistance in Ohm and supply in V of the electronics."""

PITCH, CORE, CORE_HEIGHT, PAD_SIDE = 3.55, 2.55, 1.05, 25.0
"""Dimensions of the pad in mm: distance and side of the square cores on which its cells are cast, their height, and the
side of the pad."""
WINDOW, COLLAR_HEIGHT, PACKAGE_HEIGHT = 1.95, 0.5, 0.5
"""Dimensions of the rigid grid in mm: side of its windows, height of its collars, which reach into the cells, and
height of the packages, which equals the thickness of its plate."""

PRESSED = 13
"""Number of the taxel that was held and released: the middle one."""


class MeasuredPress(NamedTuple):
    """Record of a taxel that is pressed slowly.

    It has the voltage at rest in V, the force in N, the change of the voltage relative to rest, and the travel of the
    indenter in mm.
    """

    at_rest: float
    forces: tuple[float, ...]
    volts: tuple[float, ...]
    travels: tuple[float, ...]


PRESSES = {
    13: MeasuredPress(
        1.915,
        (0.10, 0.34, 0.58, 0.83, 1.07, 1.31, 1.55, 1.80, 2.04),
        (0.0145, 0.0550, 0.1019, 0.1444, 0.1878, 0.2411, 0.2902, 0.3401, 0.3882),
        (0.169, 0.452, 0.692, 0.906, 1.097, 1.329, 1.530, 1.736, 1.925),
    ),
    17: MeasuredPress(
        1.609,
        (0.10, 0.34, 0.58, 0.83, 1.07, 1.31, 1.55, 1.80),
        (0.0183, 0.0617, 0.0974, 0.1503, 0.1962, 0.2518, 0.3077, 0.3646),
        (0.181, 0.462, 0.650, 0.886, 1.071, 1.271, 1.453, 1.616),
    ),
    5: MeasuredPress(
        1.868,
        (0.10, 0.34, 0.58, 0.83, 1.07, 1.31, 1.55, 1.80, 2.04),
        (0.0128, 0.0489, 0.0876, 0.1224, 0.1619, 0.2093, 0.2564, 0.3077, 0.3569),
        (0.158, 0.462, 0.691, 0.898, 1.104, 1.336, 1.559, 1.774, 1.955),
    ),
}
"""Records of pressed taxels by number. Taxels are numbered as in this program: 13 is the middle, 17 is below it to the
left, 5 is the upper right corner."""
HELD_AT = 1.70
HELD_MAP = (
    (2, 2, 14, 7, 0),
    (7, 34, 66, 35, 6),
    (11, 62, 100, 48, 8),
    (6, 34, 44, 21, 1),
    (-2, 0, 4, -2, -1),
)
"""Travel in mm at which taxel 13 is held, and the relative changes of all taxels, in percent of the change of taxel 13.
"""


class HeldPress(NamedTuple):
    """Record of a taxel that is held under the indenter.

    It has the travel of the indenter in mm, the force in N, the change of the taxel's voltage relative to rest, and the
    changes of all taxels, relative to rest and in percent of that change, arranged as on the board.
    """

    travel: float
    force: float
    change: float
    changes: tuple[tuple[float, ...], ...]


HELD_PRESSES = {
    13: HeldPress(HELD_AT, 1.723, HELD_SHARE, HELD_MAP),
    17: HeldPress(
        1.421,
        1.458,
        0.1865,
        (
            (0.1, -1.3, -0.4, -0.8, -1.0),
            (8.3, 12.0, 10.4, 2.6, -0.6),
            (29.1, 56.2, 34.1, 6.9, 0.1),
            (49.8, 100.0, 57.9, 9.2, -0.4),
            (25.4, 36.8, 22.0, 1.3, -0.6),
        ),
    ),
    5: HeldPress(
        1.798,
        1.756,
        0.1677,
        (
            (-1.7, -3.1, 19.9, 56.7, 100.0),
            (-2.0, -0.6, 11.4, 28.3, 47.3),
            (-1.3, -1.0, 2.5, 7.3, 8.6),
            (-1.3, -2.0, -2.8, -1.0, -0.5),
            (-0.8, -1.4, -1.6, -1.8, -0.9),
        ),
    ),
}
"""Records of held taxels by number."""

TAIL_TIMES = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0)
TAIL_VOLTS = (45.7e-3, 20.8e-3, 12.3e-3, 7.4e-3, 4.9e-3, 3.0e-3, 2.0e-3, 0.9e-3)
"""Remaining voltage against the time in s after release from the hold."""

HELD_CHANGE = 0.15
"""Largest difference of the voltage from its value at the end of the hold, in percent of that value, from 0.5 s on."""
HOLD_WINDOWS = ((0.05, 1.0), (1.0, 3.0), (3.0, 8.0), (8.0, 30.0))
HOLD_FORCES = ((1.795, 0.072), (1.735, 0.042), (1.721, 0.028), (1.723, 0.018))
"""Mean force in N and its scatter, by window of time in s after the travel was reached, which took 0.1 s."""

CYCLE_SECONDS = 147.0
FORCE_LOOP, ENERGY_LOST = 7.5, 8.8
"""In percent: difference of the force at equal travel, relative to its largest; energy lost in a cycle."""
VOLTAGE_LOOP_AT_FORCE, VOLTAGE_LOOP_AT_TRAVEL = 4.7, 4.3
"""In percent of the largest change of the voltage."""

MEASURED_HYSTERESIS = {"parallelepiped": 1.88, "spherical": 6.87, "hemispheric": 10.3}
"""The paper's e_h in percent (section 3.1), for the most sensitive taxel."""
CELLS_OF_EXPERIMENTS = 12
RAMP_SECONDS = 50.0
"""The paper's experiments: cells of the pads, and time to 10 N."""
