"""Readings under a ball at places of a map, against single runs that solve the place itself."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel import Scene, measure
from mitsuba_taxel.mechanics import load_paths
from mitsuba_taxel.mechanics.continuation import mirrored_places

TOUCHED = """<scene version="3.9.0">
    <default name="indenter_x" value="0"/> <default name="indenter_y" value="0"/>
    <shape type="deformable_pad">
        <string name="cell" value="parallelepiped"/>
        <integer name="rows" value="2"/> <integer name="columns" value="2"/>
        <float name="mesh_size" value="2.5"/>
        <string name="load" value="indenter_displacement"/> <vector name="displacement" value="0, 0, -0.18"/>
        <string name="indenter" value="sphere"/> <float name="indenter_radius" value="9"/>
        <float name="indenter_x" value="$indenter_x"/> <float name="indenter_y" value="$indenter_y"/>
        <bsdf type="region">
            <bsdf name="roof" type="wall"> <string name="scattering" value="isotropic"/> </bsdf>
        </bsdf>
    </shape>
    <shape type="photo_reflector">
        <integer name="rows" value="2"/> <integer name="columns" value="2"/>
        <emitter type="annular_led"/> <sensor type="phototransistor"/>
    </shape>
</scene>"""


def test_readings_of_a_mirrored_place_are_those_of_its_own_run(llvm_mono, monkeypatch, tmp_path):
    """The photo-reflectors are not symmetric: their LEDs stay where they are. Within 0.3 %, and 3 % of the changes."""
    (tmp_path / "touched.xml").write_text(TOUCHED)

    def read(x, y):
        scene = Scene(tmp_path / "touched.xml", {"indenter_x": x, "indenter_y": y})
        readings = measure(scene, mechanics_error=False)
        assert not readings.points  # without random numbers
        return readings.power, readings.pads["reaction_fz"].value

    mirrored, force = read(-1.6, 1.2)
    other, _ = read(1.6, 1.2)
    for module in (mirrored_places, load_paths):
        monkeypatch.setattr(module, "canonical_place", lambda path, value: (path, value, ()))
    own, own_force = read(-1.6, 1.2)
    np.testing.assert_allclose(mirrored, own, rtol=3e-3)
    assert force != own_force and abs(force / own_force - 1) < 5e-3
    changes = np.abs(own - other)
    assert changes.max() > 0.03 * own.max()
    np.testing.assert_allclose(mirrored - other, own - other, atol=0.03 * changes.max())
