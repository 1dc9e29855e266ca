"""Settings of `taxel bench coverage` with indenters, drawn at random."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.elements.loads import IndenterDisplacement, IndenterForce
from mitsuba_taxel.mechanics.materials.laws import NeoHookean
from mitsuba_taxel.mechanics.materials.mullins import Mullins
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES, Pad
from mitsuba_taxel.sensing import PadSensor

SEED = 52
FINE_OF_TOUCH = 0.75
"""Size in mm of the finest elements of the reference. Elements below a body are proportionally smaller: with 0.4 mm,
there would be thirty times as many elements as by default."""

Setting = tuple[str, dict[str, Any]]


def touch_settings() -> Iterator[tuple[str, PadSensor]]:
    """Yield the name and the sensor of each setting: every kind of touch on each of the paper's cell shapes."""
    rng, second_rng = np.random.default_rng(SEED), np.random.default_rng(SEED + 1)
    kinds: tuple[Callable[[np.random.Generator], Setting], ...] = (
        _pressed_ball,
        _dragged_ball,
        _rubbing_ball,
        _rubbed_there_and_back,
        _punch,
        _rod,
        _plate,
        _ball_by_force,
        _ball_on_viscoelastic_silicone,
        _ball_on_a_thin_roof,
    )
    for cell in CELL_SHAPES:
        for kind in kinds:
            name, parameters = kind(rng)
            pad = Pad(cell, 1, 1, **parameters.pop("sizes", {}))
            yield f"{cell}, 1 x 1, {name}", PadSensor(pad, **parameters)
        # A generator of its own leaves the settings above as they were.
        name, parameters = _ball_on_softened_silicone(second_rng)
        yield f"{cell}, 1 x 1, {name}", PadSensor(Pad(cell, 1, 1), **parameters)


def _drawn(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number with two digits between ``low`` and ``high``, uniformly distributed on a logarithmic scale."""
    return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.2g}")


def _position(rng: np.random.Generator, largest: float = 1.5) -> tuple[float, float]:
    x, y = np.round(rng.uniform(-largest, largest, 2), 2).tolist()
    return x, y


def _ball(rng: np.random.Generator, smallest: float = 0.3) -> tuple[float, float]:
    """Draw the radius and the depth of a ball, in mm."""
    radius = _drawn(rng, smallest, 3.0)
    return radius, _drawn(rng, 0.05, min(0.4, 0.4 * radius))


def _pressed_ball(rng: np.random.Generator) -> Setting:
    (radius, depth), at = _ball(rng), _position(rng)
    load = IndenterDisplacement(Indenter(radius=radius, at=at))
    name = f"ball of {radius:g} mm at {at} mm, {depth:g} mm deep"
    return name, {"load": load, "force": (0.0, 0.0, -depth)}


def _dragged_ball(rng: np.random.Generator) -> Setting:
    (radius, depth), (x, y) = _ball(rng), _position(rng)
    name = f"ball of {radius:g} mm dragged to {(x, y)} mm, {depth:g} mm deep"
    return name, {"load": IndenterDisplacement(Indenter(radius=radius)), "force": (x, y, -depth)}


def _rubbing_ball(rng: np.random.Generator) -> Setting:
    (radius, depth), friction, x = _ball(rng, 0.8), _drawn(rng, 0.1, 1.0), _drawn(rng, 0.1, 1.5)
    load = IndenterDisplacement(Indenter(radius=radius, friction=friction))
    name = f"ball of {radius:g} mm, friction {friction:g}, dragged by {x:g} mm, {depth:g} mm deep"
    return name, {"load": load, "force": (x, 0.0, -depth)}


def _rubbed_there_and_back(rng: np.random.Generator) -> Setting:
    (radius, depth), friction, x = _ball(rng, 0.8), _drawn(rng, 0.1, 1.0), _drawn(rng, 0.1, 0.4)
    load = IndenterDisplacement(Indenter(radius=radius, friction=friction))
    rows = ((0.0, (0.0, 0.0, -depth)), (0.0, (x, 0.0, -depth)))
    name = f"ball of {radius:g} mm, friction {friction:g}, dragged by {x:g} mm and back, {depth:g} mm deep"
    return name, {"load": load, "force": (0.0, 0.0, -depth), "history": rows}


def _punch(rng: np.random.Generator) -> Setting:
    radius, depth, at = _drawn(rng, 0.6, 2.0), _drawn(rng, 0.03, 0.2), (round(float(rng.uniform(-1, 1)), 2), 0.0)
    load = IndenterDisplacement(Indenter("punch", radius=radius, at=at))
    return f"punch of {radius:g} mm at {at} mm, {depth:g} mm deep", {"load": load, "force": (0.0, 0.0, -depth)}


def _rod(rng: np.random.Generator) -> Setting:
    radius, depth, angle = _drawn(rng, 0.5, 3.0), _drawn(rng, 0.05, 0.2), float(rng.choice([0.0, 30.0, 45.0, 90.0]))
    load = IndenterDisplacement(Indenter("cylinder", radius=radius, angle=angle))
    name = f"rod of {radius:g} mm at {angle:g} degrees, {depth:g} mm deep"
    return name, {"load": load, "force": (0.0, 0.0, -depth)}


def _plate(rng: np.random.Generator) -> Setting:
    tilt, depth, friction = _drawn(rng, 0.5, 5.0), _drawn(rng, 0.05, 0.3), float(rng.choice([0.0, 0.3]))
    load = IndenterDisplacement(Indenter("plane", tilt=tilt, friction=friction))
    name = f"plate tilted by {tilt:g} degrees, friction {friction:g}, {depth:g} mm deep"
    return name, {"load": load, "force": (0.0, 0.0, -depth)}


def _ball_by_force(rng: np.random.Generator) -> Setting:
    radius, force, at = _drawn(rng, 0.5, 3.0), _drawn(rng, 0.05, 0.5), _position(rng, 1.0)
    load = IndenterForce(Indenter(radius=radius, at=at))
    return f"ball of {radius:g} mm at {at} mm, -{force:g} N", {"load": load, "force": (0.0, 0.0, -force)}


def _ball_on_viscoelastic_silicone(rng: np.random.Generator) -> Setting:
    (radius, depth), x, time = _ball(rng, 0.8), _drawn(rng, 0.2, 1.0), _drawn(rng, 0.2, 5.0)
    name = f"ball of {radius:g} mm, {depth:g} mm deep in 1 s, dragged by {x:g} mm in {time:g} s, viscoelastic"
    return name, {
        "material": Viscoelastic(NeoHookean(), ((0.2, 0.5), (0.1, 5.0))),
        "load": IndenterDisplacement(Indenter(radius=radius)),
        "force": (x, 0.0, -depth),
        "history": ((1.0, (0.0, 0.0, -depth)),),
        "time": 1.0 + time,
    }


def _ball_on_softened_silicone(rng: np.random.Generator) -> Setting:
    (radius, depth), r, again = _ball(rng, 0.8), _drawn(rng, 1.3, 3.0), round(float(rng.uniform(0.3, 0.9)), 2)
    m = _drawn(rng, 0.002, 0.1)
    name = f"ball of {radius:g} mm, {depth:g} mm deep and {again:g} of it again, Mullins' effect {r:g}, {m:g} MPa"
    return name, {
        "material": Mullins(NeoHookean(), r, m, 0.1),
        "load": IndenterDisplacement(Indenter(radius=radius)),
        "force": (0.0, 0.0, -round(again * depth, 4)),
        "history": ((0.0, (0.0, 0.0, -depth)), (0.0, (0.0, 0.0, 0.0))),
    }


def _ball_on_a_thin_roof(rng: np.random.Generator) -> Setting:
    radius, depth, roof = _drawn(rng, 2.0, 3.0), round(float(rng.uniform(0.5, 0.8)), 2), _drawn(rng, 0.8, 1.2)
    return (
        f"ball of {radius:g} mm on a roof {roof:g} mm thick, {depth:g} mm deep, self-contact",
        {
            "sizes": {"cell_size": 2.0, "cell_height": 1.1, "height": 1.1 + roof, "wall": 1.0},
            "load": IndenterDisplacement(Indenter(radius=radius), self_contact=True),
            "force": (0.0, 0.0, -depth),
        },
    )
