"""Materials of pads: laws by their names, also a law that a user defines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from mitsuba_taxel import InputError, Pad, PadSensor, Scene, measure
from mitsuba_taxel.mechanics import NeoHookean, SpreadForce, load_path
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.specification.deformable_pad import DeformablePad
from mitsuba_taxel.specification.wall import Wall


@pytest.fixture
def gent() -> Iterator[Any]:
    """A law of the user, forgotten afterwards."""

    @dataclass(frozen=True)
    class Gent(Material, name="test_gent"):
        """A. N. Gent, Rubber Chem. Technol. 69, 59, 1996; numbers without ranges."""

        stiffness: float
        locking: float = 30.0
        poisson_ratio: float = 0.49

        def strain_energy(self, i1, i2):
            return -self.stiffness * self.locking / 2 * np.log(1 - (i1 - 3) / self.locking)

    yield Gent
    del Material._registry["test_gent"]


@dataclass(frozen=True)
class Nameless(Material):
    stiffness: float = 1.0
    poisson_ratio: float = 0.49

    def strain_energy(self, i1, i2):
        return self.stiffness / 2 * (i1 - 3)


def test_numbers_of_a_law_are_parameters_of_the_pad(gent):
    pad = DeformablePad(material="test_gent", stiffness=0.7)
    assert pad.build_material() == gent(0.7) and pad.locking == 30.0
    assert DeformablePad(material="arruda_boyce", chain_modulus=0.5, locking_stretch=3).build_material().name
    with pytest.raises(InputError, match="stiffness is missing"):
        DeformablePad(material="test_gent")
    with pytest.raises(InputError, match="locking is not allowed for material = 'yeoh', only for 'test_gent'"):
        DeformablePad(material="yeoh", c10=1.0, locking=30.0)


def test_a_law_of_the_user_works_in_load_paths_sensors_and_scenes(gent, tmp_path):
    pad, law = Pad(rows=1, columns=1), gent(0.7)
    sensor = PadSensor(pad, law, force=(0.0, 0.0, -1.0), roof=Wall("lambertian", 0.9))
    sensor.scene().write_xml(tmp_path / "gent.xml")
    scenes = sensor.scene(), Scene.from_file(tmp_path / "gent.xml")
    readings = [measure(scene, mechanics_error=False) for scene in scenes]
    assert readings[0].power[0] == readings[1].power[0] > 0
    assert 'name="material" value="test_gent"' in (tmp_path / "gent.xml").read_text()
    # At small strain it is the neo-Hookean law of the same shear modulus.
    force = [(0.0, 0.0, -0.01)]
    own, usual = (
        load_path(pad, material, force, load=SpreadForce())[0].displacement
        for material in (law, NeoHookean(2 * 0.7 * 1.49, 0.49))
    )
    assert np.abs(own - usual).max() < 1e-3 * np.abs(usual).max()


def test_a_law_without_a_name_is_refused_with_the_remedy():
    with pytest.raises(InputError, match=r'needs a name, as in class Nameless\(Material, name="nameless"\)'):
        PadSensor(Pad(rows=1, columns=1), Nameless())
