"""Readings of cells that lean: those of the same solid, drawn and meshed by itself."""

from __future__ import annotations

import pytest

from mitsuba_taxel import Pad, Scene
from mitsuba_taxel.pads.parametric.drawings import write_drawings
from mitsuba_taxel.sensing.deterministic_light import deterministic_light


def reading(force, **pad):
    roof = {"type": "region", "roof": {"type": "wall", "scattering": "isotropic"}}
    parts = {
        "pad": {"type": "deformable_pad", "mesh_size": 1.5, "force": force, "bsdf": roof, **pad},
        "package": {"type": "photo_reflector", "led": {"type": "annular_led"}, "sensor": {"type": "phototransistor"}},
    }
    return deterministic_light(Scene({"type": "scene", **parts}).load(), False).power[0]


@pytest.mark.parametrize(("force", "error"), [([0.0, 0.0, 0.0], 5e-5), ([0.1, 0.05, -1.0], 1e-3)], ids=["rest", "load"])
def test_the_drawing_reads_the_same(force, error, tmp_path):
    """But for another mesh; upright cells read 7 % more."""
    lean = {"cell": "cylindrical", "rows": 1, "columns": 1, "top_x": 0.4, "top_y": 0.2}
    write_drawings(Pad(**lean), tmp_path)
    drawn = reading(force, filename=str(tmp_path / "pad.step"))
    assert drawn == pytest.approx(reading(force, **lean), rel=error)
    assert reading(force, **{**lean, "top_x": 0.0, "top_y": 0.0}) > 1.05 * drawn
