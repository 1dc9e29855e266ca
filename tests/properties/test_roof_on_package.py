"""Light where the roof of a cell comes down on its package, on elements of the default size."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import Scene, check_scene, energy_audit, measure

pytest.importorskip("ipctk")

SCENE = """
<scene version="3.9.0">
    <default name="dz" value="-0.3"/>
    <integrator type="taxel_tracer"/>
    <shape type="deformable_pad">
        <integer name="rows" value="1"/> <integer name="columns" value="1"/>
        <float name="cell_height" value="0.9"/> <float name="height" value="2.5"/>
        <string name="load" value="plate_displacement"/> <boolean name="self_contact" value="true"/>
        <vector name="displacement" value="0, 0, $dz"/>
        {wall}
    </shape>
    <shape type="photo_reflector">
        <emitter type="annular_led"> <string name="law" value="lambertian"/> </emitter>
        <sensor type="phototransistor"/>
    </shape>
</scene>
"""
WALL = '<bsdf name="{}" type="wall"> <string name="scattering" value="isotropic"/> </bsdf>'
ROOF = f'<bsdf type="region">{WALL.format("roof")}</bsdf>'
RESTS = "the roof of cell 1 rests on a package: no light passes where they touch"


@pytest.fixture
def pressed(tmp_path):
    """A function that makes the scene with a wall and a depth."""

    def scene(depth, wall=ROOF):
        file = tmp_path / "scene.xml"
        file.write_text(SCENE.format(wall=wall))
        return Scene(file, {"dz": depth})

    return scene


@pytest.mark.parametrize("wall", [ROOF, WALL.format("any")], ids=["roof", "all walls"])
def test_light_stays_away_while_the_roof_rests_on_the_package(pressed, wall):
    """The even gap that the barrier leaves between them would let through 2e-4 W at the last depths."""
    before, *resting = (measure(pressed(depth, wall), points=4096) for depth in (-0.35, -0.42, -0.6))
    assert before.power > 1e-3 and RESTS not in before.notes
    for reading in resting:
        assert reading.power < 1e-5 and RESTS in reading.notes
        assert 0 < reading.total_error < 1e-4 and np.isfinite(reading.total_error)


def test_the_error_where_the_roof_is_about_to_touch(pressed):
    """Elements of 1 mm let 3.43e-4 W through, those of the default size next to nothing."""
    reading = measure(pressed(-0.38), points=1024)
    assert reading.power < 1e-5 and abs(reading.power - 3.43e-4) < 2 * reading.total_error < 2e-3


def test_what_touches_is_told_without_light(pressed):
    scene = pressed(-0.5)
    found = [finding.message for finding in check_scene(scene.source, dz=-0.5) if finding.severity == "warning"]
    assert found == [f"{RESTS}."]
    assert not any("rests" in finding.message for finding in check_scene(scene.source, dz=-0.3))


def test_light_that_comes_to_the_walls_in_contact_ends_there(pressed):
    audit = energy_audit(pressed(-0.5), points=1 << 10)
    share = dict(zip(audit.places, audit.share, strict=True))
    assert share["deformable_pad in contact"] > 0.4 and audit.total == pytest.approx(1, abs=1e-9)
