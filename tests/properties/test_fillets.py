"""Light in cells with rounded edges."""

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import Pad, PadSensor, Scene, measure
from mitsuba_taxel.pads.parametric.drawings import write_drawings
from mitsuba_taxel.specification.wall import ABSORBING, Wall

REST = (0.0, 0.0, 0.0)


def reading(pad, side=ABSORBING, **arguments):
    return measure(PadSensor(pad, force=REST, side=side).scene(), mechanics_error=False, **arguments)


@pytest.mark.parametrize("cell", ["parallelepiped", "cylindrical"])
def test_light_of_small_fillets_converges_to_that_of_sharp_edges(cell):
    sharp, small, wide = (reading(Pad(cell, rows=1, columns=1, fillet=f)).power[0] for f in (0.0, 0.04, 0.08))
    assert small < 0.99 * sharp
    assert 2 * small - wide == pytest.approx(sharp, rel=2e-3)


@pytest.mark.parametrize(
    ("cell", "name"), [("parallelepiped", "fillet"), ("cylindrical", "fillet"), ("cylindrical", "mouth_fillet")]
)
def test_the_derivative_by_the_radius_is_that_of_moved_pads(cell, name):
    pad, step = Pad(cell, rows=1, columns=1, **{name: 0.2}), 2e-3
    side = Wall("lambertian", 0.9) if name == "mouth_fillet" else ABSORBING  # below the LED's plane
    derivatives = reading(pad, side, derivatives=(name,)).derivatives
    ends = [reading(pad.changed(**{name: 0.2 + sign * step}).moved_from(pad), side).power[0] for sign in (1, -1)]
    rate = (ends[0] - ends[1]) / (2 * step)
    tolerance = 5 * float(np.ravel(derivatives.standard_errors)[0]) + 0.01 * abs(rate)
    assert float(np.ravel(derivatives.values)[0]) == pytest.approx(rate, abs=tolerance)


@pytest.mark.parametrize(("cell", "mouth"), [("parallelepiped", 0.0), ("cylindrical", 0.0), ("cylindrical", 0.25)])
def test_a_reading_is_that_of_the_pads_drawing_meshed_by_netgen(cell, mouth, tmp_path):
    """A Z-test at 4 standard deviations; equal walls, as faces of a file that round an edge count as roof."""
    pad = Pad(cell, rows=1, columns=1, fillet=0.3, mouth_fillet=mouth)
    write_drawings(pad, tmp_path)
    fillets = f'<float name="fillet" value="0.3"/> <float name="mouth_fillet" value="{mouth}"/>'
    own = one_cell(cell=cell, mesh_size=1.25).replace("<string", f"{fillets} <string", 1)
    walls = '<bsdf name="side" type="wall"> <string name="scattering" value="lambertian"/> </bsdf>'
    own = own.replace('<bsdf name="roof"', f'{walls} <bsdf name="roof"')
    drawn = own.replace(fillets, f'<string name="filename" value="{tmp_path}/pad.step"/>')
    for name in ("rows", "columns"):
        drawn = drawn.replace(f'<integer name="{name}" value="1"/>', "")
    drawn = drawn.replace(f'<string name="cell" value="{cell}"/>', "")
    readings = []
    for name, text in (("own", own), ("drawn", drawn)):
        (tmp_path / f"{name}.xml").write_text(text)
        readings.append(measure(Scene(tmp_path / f"{name}.xml"), points=512, mechanics_error=False))
    difference = readings[0].power[0] - readings[1].power[0]
    error = np.hypot(*(reading.standard_error[0] for reading in readings))
    assert abs(difference) < 4 * error + 5e-4 * readings[0].power[0]
    assert error < 0.01 * readings[0].power[0]
