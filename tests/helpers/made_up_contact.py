"""A model of contact without finite elements, and solutions that differ from it by known terms."""

from __future__ import annotations

import numpy as np
from half_space import grid, half_space

from mitsuba_taxel.surrogates.contact_readings import ContactModel
from mitsuba_taxel.surrogates.contact_states import SolvedTouch, touches


def linear_model(taxels=2):
    """A model of contact of a half-space, with readings that depend on forces near each of two taxels."""
    side = 0.4
    x, y = grid(11, side)
    middle = np.array([[-0.8, 0.0], [0.8, 0.0]])[:taxels]
    squares = (x - middle[:, :1]) ** 2 + (y - middle[:, 1:]) ** 2
    edges = np.unique(x)
    return ContactModel(
        x=edges,
        y=edges[::-1],
        size=(side, side),
        height=3.0,
        covered=np.ones((11, 11), dtype=bool),
        compliance=half_space(x, y[::-1], side) / 0.4,
        rest=np.array([4e-3, 5e-3])[:taxels],
        gradient=4e-3 * np.exp(-squares),
        largest_depth=0.4,
        places=np.array([[-2.0, -2.0], [2.0, 2.0]]),
    )


def made_up(model, count, reading, force, noise=0.0):
    """Solutions of bodies with given second-order terms, computed from the definition."""
    rng, solved = np.random.default_rng(4), []
    for touch in touches(model, count):
        power, forces, moments = [], [], []
        for depth in touch.depths:
            maps = touch.below(model.points, depth)
            linear = model(maps)
            change, deep = (linear.power - model.rest)[0], maps.max() / model.height
            wide = np.sqrt(linear.area[0]) / model.height
            changed = change + reading[0] * change**2 / model.rest + reading[1] * deep * change
            ratio = 1 + force[0] * deep + force[1] * wide
            power.append(model.rest + changed * (1 + noise * rng.normal(size=len(change))))
            forces.append(linear.force[0] * ratio)
            moments.append(linear.moment[0] * ratio)
        lists = (np.array(rows).tolist() for rows in (power, forces, moments))
        solved.append(SolvedTouch(touch, *lists))
    return solved
