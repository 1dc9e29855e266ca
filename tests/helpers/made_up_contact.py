"""A contact model without finite elements, and solutions that differ from it by known terms."""

from __future__ import annotations

import numpy as np
from half_space import grid, half_space

from mitsuba_taxel.surrogates.contact_readings import ContactModel
from mitsuba_taxel.surrogates.contact_states import SolvedTouch, touches


def linear_model(taxels=2):
    """A contact model of a half-space, with readings that depend on forces near each of two taxels."""
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
    """Solutions of bodies with given terms (4,) of readings and force, computed from the definition."""
    rng, solved = np.random.default_rng(4), []
    for touch in touches(model, count):
        power, forces, moments = [], [], []
        for depth in touch.depths:
            maps = touch.below(model.points, depth)
            linear = model(maps)
            pressed = linear.pressure[0].ravel() * np.prod(model.size)
            deep, total = maps.max() / model.height, pressed.sum()
            apart = (pressed * (model.points.reshape(-1, 3)[:, :2] ** 2).sum(axis=1)).sum() / total / model.height**2
            wide = np.sqrt(linear.area[0]) / model.height
            ratio = 1 + np.dot(force, [1, deep, wide, deep * apart])
            change = (linear.power - model.rest)[0] * ratio
            strain = ratio * total * model.compliance.mean() / model.height
            changed = change * (1 + np.dot(np.stack([1 + 0 * change, change / model.rest, deep + 0 * change,
                                                     strain + 0 * change], axis=1), reading))  # fmt: skip
            power.append(model.rest + changed * (1 + noise * rng.normal(size=len(change))))
            forces.append(linear.force[0] * ratio)
            moments.append(linear.moment[0] * ratio)
        lists = (np.array(rows).tolist() for rows in (power, forces, moments))
        solved.append(SolvedTouch(touch, *lists))
    return solved
