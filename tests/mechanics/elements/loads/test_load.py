"""What every load has to answer, and a load of one's own, from its definition to readings of a sensor."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest

from mitsuba_taxel import PadSensor
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import ACROSS_X, ACROSS_Y
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.mechanics import Indenter, IndenterShape, NeoHookean, load_path
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.derivatives.sensitivities import linearise
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE, DeadForce, Load
from mitsuba_taxel.mechanics.elements.loads.load import face_areas, top_faces
from mitsuba_taxel.mechanics.equilibrium.pad_parts import mirror_images
from mitsuba_taxel.mechanics.results.balance import reactions
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.parameters import REQUIRED, number, parameters_of
from mitsuba_taxel.specification.deformable_pad import DeformablePad

PAD, LAW, SIZE = Pad("parallelepiped", 1, 1, cell_size=2.0, cell_height=1.0, height=2.0, wall=1.0), NeoHookean(), 1.0
PER_SIDE = 24
"""Points along the side of a face."""


@pytest.fixture
def disk_force():
    """A force on a disk of the top, most in its middle, as a script would define it."""

    @dataclass(frozen=True)
    class DiskForce(DeadForce, name="disk_force"):
        radius: float = number(REQUIRED, "mm", "Radius of the disk.", above=0)
        x: float = number(0.0, "mm", "Its centre along x.")

        meaning = "on a disk of the top"
        loads_rim = False

        def nodal(self, mesh):
            top = top_faces(mesh)
            steps = (np.arange(PER_SIDE) + 1 / 3) / PER_SIDE
            at = np.array([(a, b, 1 - a - b) for a in steps for b in steps if a + b < 1])
            values = shape_functions(at)
            points = np.einsum("qa,fai->fqi", values, mesh.points[top])
            profile = np.maximum(1 - ((points[..., 0] - self.x) ** 2 + points[..., 1] ** 2) / self.radius**2, 0.0)
            weights = np.einsum("fq,qa->fa", profile, values) * (face_areas(mesh, top) / len(at))[:, None]
            return np.bincount(top.ravel(), weights=weights.ravel(), minlength=len(mesh.points))

    yield DiskForce
    del Load._registry["disk_force"]


@pytest.mark.parametrize("kind", Load.kinds().values(), ids=Load.kinds())
def test_every_load_has_a_value_in_scenes_and_one_boundary_condition(kind):
    assert {"force": "N", "displacement": "mm", "pressure": "MPa"}[kind.quantity] == kind.unit
    assert kind.components == (1 if kind.quantity == "pressure" else 6 if kind.tilts else 3)
    used = {name for name, parameter in parameters_of(DeformablePad).items() if kind.name in parameter.when}
    assert kind.quantity in used and len(used & {"force", "displacement", "pressure"}) == 1
    assert [kind.dead, kind.bonded_plate, kind.follows_surface, "indenter" in kind.uses].count(True) == 1
    assert kind.meaning and len(kind.position) in (0, 2) and used.issuperset(kind.position)


@pytest.mark.parametrize("kind", Load.kinds(), ids=str)
def test_every_load_of_a_scene_is_that_of_its_parts(kind):
    pytest.importorskip("ipctk")
    given = {Load.named(kind).quantity: 0.01 if kind == "pressure" else (0.0, 0.0, -0.1)}
    needed = [p for p in parameters_of(DeformablePad).values() if kind in p.when and p.default_text == ""]
    given |= {parameter.name: 1.5 for parameter in needed}
    if "indenter" in Load.named(kind).uses:
        given |= {"indenter_radius": 2.0, "indenter_x": 0.3}
    touches = not Load.named(kind).tilts
    if not touches:
        given |= {"moment": (0.1, 0.2, -0.1), "load_x": 0.3}
    pad = DeformablePad(load=kind, self_contact=touches, **given)
    load, value = pad.build_load()
    assert type(load).name == kind and load.self_contact == touches
    assert DeformablePad.of(pad.build_pad(), LAW, load, value, None).build_load() == (load, value)


def test_a_load_with_self_contact_is_refused_without_its_package(monkeypatch):
    """Before anything is meshed, also where the value of the load is zero; loads without it are allowed."""
    monkeypatch.setitem(sys.modules, "ipctk", None)
    with pytest.raises(InputError, match="^self_contact needs the package ipctk: pip install ipctk, for which [^\n]*$"):
        DeformablePad(self_contact=True).build_load()
    DeformablePad().build_load()


def test_a_force_on_a_disk_of_ones_own_deforms_a_pad(disk_force):
    load, value = disk_force(0.8), np.array([0.05, 0.0, -0.4])
    (state,) = load_path(PAD, LAW, [value], load=load, mesh_size=SIZE)
    assert load.loaded_area(state.mesh) == pytest.approx(np.pi * 0.8**2 / 2, rel=1e-2)
    nodal = disk_force(0.8, 0.1).nodal(state.mesh)
    np.testing.assert_allclose(nodal @ state.mesh.points / nodal.sum(), [0.1, 0.0, PAD.height], atol=1e-3)
    assert set(mirror_images(state.mesh, load)) >= {ACROSS_X, ACROSS_Y}
    assert ACROSS_X not in mirror_images(state.mesh, replace(load, x=0.3))
    found = reactions(state)
    np.testing.assert_allclose(found.force, -value, atol=1e-6)
    assert found.imbalance < 1e-6

    def deepest(load):
        (state,) = load_path(PAD, LAW, [value], load=load, mesh_size=SIZE)
        return state.displacement[:, 2].min()

    assert deepest(load) < 1.5 * deepest(SPREAD_FORCE)  # both are below 0
    assert deepest(disk_force(40.0)) == pytest.approx(deepest(SPREAD_FORCE), rel=5e-3)


def test_its_states_have_a_derivative_by_its_position(disk_force):
    value, step = (0.0, 0.0, -0.3), 0.02

    def moved(x):
        return load_path(PAD, LAW, [value], load=disk_force(0.8, x), mesh_size=SIZE)[0]

    rate = linearise(moved(0.0)).by_place((1.0, 0.0))
    change = (moved(step).displacement - moved(-step).displacement) / (2 * step)
    assert np.abs(rate - change).max() < 0.02 * np.abs(change).max()


def test_scenes_and_sensors_have_it(disk_force):
    pad = DeformablePad(load="disk_force", load_radius=0.8, force=(0, 0, -0.2))
    assert pad.build_load() == (disk_force(0.8), (0.0, 0.0, -0.2))
    with pytest.raises(InputError, match="load_radius is missing"):
        DeformablePad(load="disk_force")
    with pytest.raises(InputError, match="load_radius is not allowed for load = 'spread_force', only for 'disk_force'"):
        DeformablePad(load_radius=0.8)
    sensor = PadSensor(pad=Pad(rows=1, columns=1), load=disk_force(0.8, 0.2), force=(0, 0, -0.2))
    live = sensor.scene().load()
    assert [shape.load for shape in live.shapes() if hasattr(shape, "load")] == [sensor.load]


def test_what_one_lacks_is_named_when_it_is_defined():
    with pytest.raises(TypeError, match="load 'stamp': .*Stamp lacks loads_rim, nodal"):
        type("Stamp", (DeadForce,), {}, name="stamp")
    with pytest.raises(InputError, match="load = 'weight' is not allowed: one of spread_force, patch_force"):
        DeformablePad(load="weight")
    with pytest.raises(InputError, match="load = .*a load, such as SpreadForce"):
        load_path(PAD, LAW, [(0, 0, 0)], load="spread_force")


def test_states_of_a_load_that_is_defined_anew_are_solved_anew():
    """Under the same name, in the same file or notebook."""
    source = """
@dataclass(frozen=True)
class Slope(DeadForce, name="slope"):
    loads_rim = True
    def nodal(self, mesh):
        return SPREAD_FORCE.nodal(mesh) * (1 + {slope} * mesh.points[:, 0])
"""
    keys, deepest = [], []
    try:
        for slope in (0.0, 0.3, 0.3):
            space = {"__name__": "cell", "dataclass": dataclass, "DeadForce": DeadForce, "SPREAD_FORCE": SPREAD_FORCE}
            exec(source.format(slope=slope), space)
            load = space["Slope"]()
            keys.append(pad_path(PAD, LAW, load, SIZE).key_parts)
            (state,) = load_path(PAD, LAW, [(0, 0, -0.4)], load=load, mesh_size=SIZE)
            deepest.append(state.displacement[:, 2].min())
    finally:
        del Load._registry["slope"]
    assert keys[0] != keys[1] == keys[2]
    assert deepest[1] < 1.05 * deepest[0] and deepest[1] == deepest[2]


def test_so_are_those_of_a_body_and_of_a_cell():
    assert Indenter("sphere", radius=1.0).digest == "" and "code" not in PAD.identity
    sphere = IndenterShape.named("sphere")
    try:
        digests = []
        for factor in (1.0, 2.0):
            space = {"__name__": "cell", "Sphere": sphere}
            exec(f"class Blunt(Sphere, name='blunt'):\n    factor = {factor}", space)
            digests.append(Indenter("blunt", radius=1.0).digest)
    finally:
        del IndenterShape._registry["blunt"]
    assert digests[0] and digests[0] != digests[1]
