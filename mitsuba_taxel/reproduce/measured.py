"""Published measurements of real sensors, for comparison.

The pad is by the paper's authors (Vanvitelli Robotics, project REMODEL, public repository of its sensor), with 5 x 5
photo-reflectors NJL5908AR, pressed at taxel 13 by a robot; the paper's tables are in `paper`.
"""

from __future__ import annotations

REST_VOLTAGE, HELD_SHARE = 1.68, 0.173
"""Mean of 25 taxels, in V; change while taxel 13 is held, relative to its own."""
LOAD_RESISTANCE, ADC_REFERENCE, ADC_BITS = 22e3, 3.3, 12
"""Electronics, in Ohm and V."""

TAIL_TIMES = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0)
TAIL_VOLTS = (45.7e-3, 20.8e-3, 12.3e-3, 7.4e-3, 4.9e-3, 3.0e-3, 2.0e-3, 0.9e-3)
"""Remaining voltage against the time in s after release from the hold."""

HOLD_WINDOWS = ((0.05, 1.0), (1.0, 3.0), (3.0, 8.0), (8.0, 30.0))
HOLD_FORCES = ((1.795, 0.072), (1.735, 0.042), (1.721, 0.028), (1.723, 0.018))
"""Force in N with its scatter, in windows of s after the travel was reached, within 0.1 s."""

CYCLE_SECONDS = 147.0
FORCE_LOOP, ENERGY_LOST = 7.5, 8.8
"""In percent: difference of the force at equal travel, relative to its largest; energy lost in a cycle."""

MEASURED_HYSTERESIS = {"parallelepiped": 1.88, "spherical": 6.87, "hemispheric": 10.3}
"""The paper's e_h in percent (section 3.1), for the most sensitive taxel."""
CELLS_OF_EXPERIMENTS = 12
RAMP_SECONDS = 50.0
"""The paper's experiments: cells of the pads, and time to 10 N."""
