"""Readings of rough walls, and their differences between two deformations, beside a tracer without triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rough_walls import Grooves as GroovedRoof
from rough_walls import Heights, Staircase, readings

from mitsuba_taxel import Grooves, LayerSteps, Pad, PadSensor, RandomRoughness, SeparateFinish, Wall, measure
from mitsuba_taxel.sensing.reading.mechanics_error import moved

RAYS, POINTS, REFLECTANCE = 150_000, 512, 0.9
DEFORMATIONS = ((1.0, 1.0), (1.03, 0.92))
"""Stretch across and along z: at rest, and pressed by 8 %."""
STEPS = [("spherical", 0.2, 0.0), ("spherical", 0.1, 0.03), ("hemispheric", 0.15, -0.05)]
GROOVES = [(0.3, 0.1, (1, 0)), (0.2, 0.12, (0, 1)), (0.5, 0.3, (1, 1))]
HEIGHTS = [(0.02, 0.3), (0.04, 0.4), (0.05, 0.3)]


def program(pad, finish):
    """(32, 2) W, readings of the replicates for both deformations."""
    sensor = PadSensor(pad, roof=Wall("isotropic", REFLECTANCE), finish=finish)
    scene = sensor.scene().load()
    (shape,) = (shape for shape in scene.shapes() if hasattr(shape, "moved_places"))
    columns = []
    for across, along in DEFORMATIONS:
        displacement = shape.state.mesh.points * [across - 1, across - 1, along - 1]
        places = shape.moved_places(replace(shape.state, displacement=displacement), shape.pad)
        with moved(scene, [shape], [places]):
            columns.append(measure(scene, points=POINTS, seed=5, mechanics_error=False).replicates[:, 0])
    return np.stack(columns, axis=1)


def assert_agree(pad, finish, roof_of):
    """Both readings and their difference agree within three standard errors: false alarms of 0.8 % a setting, which
    the fixed seeds draw once. The tracer's rays and the program's replicates are common to both deformations."""
    ours = program(pad, finish)
    theirs = np.stack([readings(roof_of(*stretch), REFLECTANCE, RAYS) for stretch in DEFORMATIONS], axis=1)
    for combination in ([1, 0], [0, 1], [-1, 1]):
        a, b = ours @ combination, theirs @ combination
        error = np.hypot(a.std(ddof=1) / np.sqrt(len(a)), b.std(ddof=1) / np.sqrt(len(b)))
        assert abs(a.mean() - b.mean()) < 3 * error, (combination, a.mean(), b.mean(), error)
        assert error < 0.015 * theirs.mean()  # steps and grooves change readings by 20 to 60 %


@pytest.mark.parametrize("cell, layer, offset", STEPS)
def test_staircase(llvm_mono, cell, layer, offset):
    pad = Pad(cell, rows=1, columns=1)
    sphere = pad.shape.roof_radius

    def roof_of(across, along):
        centre = pad.top_of_cell - sphere
        return Staircase.of_dome(0.5 * pad.cell_size, pad.side_height, sphere, centre, layer, offset, across, along)

    assert_agree(pad, LayerSteps(layer, offset=offset), roof_of)


@pytest.mark.parametrize("pitch, depth, direction", GROOVES)
def test_grooves(llvm_mono, pitch, depth, direction):
    pad = Pad("parallelepiped", rows=1, columns=1)

    def roof_of(across, along):
        width, height = across * 0.5 * pad.cell_size, along * pad.top_of_cell
        return GroovedRoof(width, height, across * pitch, along * depth, direction)

    assert_agree(pad, SeparateFinish(roof=Grooves(pitch, depth, (*direction, 0))), roof_of)


@pytest.mark.parametrize("rms_height, correlation_length", HEIGHTS)
def test_random_heights(llvm_mono, rms_height, correlation_length):
    pad = Pad("parallelepiped", rows=1, columns=1)
    finish = RandomRoughness(rms_height, correlation_length, 3)

    def roof_of(across, along):
        return Heights.of_finish(finish, 0.5 * pad.cell_size, pad.top_of_cell, across, along)

    assert_agree(pad, SeparateFinish(roof=finish), roof_of)
