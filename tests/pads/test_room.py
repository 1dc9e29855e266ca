"""How wide a cell must be for a package, against closed forms, and what a load of the scene says."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import InputError, Pad, PadSensor, PhotoReflector, check_scene, write_xml
from mitsuba_taxel.pads.room import room_needed

CORNERS = np.array([(x, y, z) for x in (-0.73, 0.73) for y in (-0.53, 0.53) for z in (0.0, 0.5)])
DIAGONAL = float(np.hypot(1.46, 1.06))


@pytest.mark.parametrize(
    ("pad", "shift", "width"),
    [
        (Pad("parallelepiped", 1, 1, cell_size=1.0), (0, 0), 1.46),
        (Pad("parallelepiped", 1, 1, cell_size=1.0), (0.2, 0), 1.86),
        (Pad("cylindrical", 3, 3, cell_size=1.0), (0, 0), DIAGONAL),
        (Pad("cylindrical", 1, 3, cell_size=1.0), (3.55, 0), DIAGONAL),
        (Pad("hemispheric", 1, 1, cell_size=1.0), (0, 0), DIAGONAL),
        # A cap of radius s, 0.7 mm high, is 0.5 mm high at the corners if s - sqrt(s^2 - c^2) = 0.2.
        (Pad("spherical", 1, 1, cell_size=1.0, cell_height=0.7), (0, 0), (DIAGONAL**2 / 4 + 0.04) / 0.4),
    ],
)
def test_least_width(pad, shift, width):
    said = room_needed(pad, CORNERS + [*shift, 0])
    size = float(said.split("at least ")[1].split(" mm")[0])
    assert said.startswith("a package of 1.46 x 1.06 mm needs cells")
    assert width <= size <= width + 0.011


def test_no_width_helps_a_low_cell():
    pad = Pad("parallelepiped", 1, 1, cell_height=0.4)
    assert room_needed(pad, CORNERS) == "its cells, 0.4 mm high, are too low for a package of 0.5 mm"


def test_scenes_say_so_as_they_are_loaded_and_checked(tmp_path, llvm_mono):
    scene = PadSensor(Pad("cylindrical", 1, 1, cell_size=1.5), photo_reflector=PhotoReflector()).scene()
    with pytest.raises(InputError, match="move one of them; a package of 1.46 x 1.06 mm needs cells at least 1.81 mm"):
        scene.load()
    write_xml(scene, tmp_path / "scene.xml")
    (found,) = [one.message for one in check_scene(tmp_path / "scene.xml") if one.severity == "error"]
    assert "stands in the silicone" in found and "needs cells at least 1.81 mm wide there; or move it" in found
