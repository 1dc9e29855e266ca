"""Whatever the functions and classes of the package are handed, they take it or refuse it in one line."""

from __future__ import annotations

import inspect
import os
from pathlib import Path

import numpy as np
import pytest

import mitsuba_taxel
from mitsuba_taxel import (
    AnnularLed,
    ArrudaBoyce,
    Block,
    Circuit,
    ComputationError,
    Grooves,
    Indenter,
    IndenterDisplacement,
    IndenterForce,
    InputError,
    LayerSteps,
    MooneyRivlin,
    Mullins,
    NeoHookean,
    Ogden,
    Pad,
    PadFile,
    PadSensor,
    PatchForce,
    PhotoReflector,
    Phototransistor,
    PlateWrench,
    RandomRoughness,
    Scene,
    SeparateFinish,
    Viscoelastic,
    Wall,
    Yeoh,
    check_scene,
    crosstalk,
    energy_audit,
    from_shore_a,
    linearise,
    load_path,
    load_plugins,
    measure,
    mesh_velocity,
    open_study,
    read_circuit,
    run_study,
    show,
    silicone,
    sweep,
    tessellate,
    training_set,
    write_template,
    write_xml,
)

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

WITHOUT_ARGUMENTS = {"InputError", "ComputationError", "PlateDisplacement", "PlateForce", "Pressure", "SpreadForce"}
NOT_FOR_CALLERS = {"Readings", "DeadForce", "IndenterShape", "Material"}
JUNK = [
    None, 3, -1, 1.5, float("nan"), 10**400, True, "", "x", "a\0b", "y" * 5000, b"x", [], ["a", "b"], [[1, 2], [3]],
    {"a": 1}, {1: 2}, (None, None, None), {1, 2}, object(), int, Path("nowhere"), np.array([1.0, 2.0]), np.array(3.0),
    1j, range(3), Wall(), Pad(), slice(1), Exception("of\ntwo lines"),
]  # fmt: skip

SMALL = Pad("cylindrical", rows=1, columns=1)


@pytest.fixture(scope="module")
def there(tmp_path_factory):
    """What calls need that go well: a study, on disk too, a deformed pad, and a loaded scene."""
    folder = tmp_path_factory.mktemp("there")
    before = os.getcwd()
    os.chdir(folder)
    study = sweep("plate.xml", {"z": "0.6"}, points=1, output="study")
    state = load_path(SMALL, NeoHookean(), [(0, 0, -0.1)], mesh_size=2.0)[0]
    yield {"study": study, "state": state, "live": Scene("plate.xml").load()}
    os.chdir(before)


def sensor(**parts):
    """A scene of these parts, parsed but not built: what a plugin makes of a value is told elsewhere."""
    return PadSensor(**{"pad": SMALL, **parts}).scene()


def calls(there):
    """By name: what is called, where its parameters are listed, and arguments with which it goes well."""
    return {
        "AnnularLed": (lambda **k: sensor(photo_reflector=PhotoReflector(led=AnnularLed(**k))), AnnularLed, {}),
        "Circuit": (Circuit, Circuit, {"supply": 3.3, "load_resistance": 22e3, "transfer": 8.0}),
        "Grooves": (Grooves, Grooves, {"pitch": 0.1, "depth": 0.1}),
        "SeparateFinish": (SeparateFinish, SeparateFinish, {"roof": Grooves(pitch=0.1, depth=0.1)}),
        "LayerSteps": (LayerSteps, LayerSteps, {"layer_height": 0.1}),
        "ArrudaBoyce": (ArrudaBoyce, ArrudaBoyce, {"chain_modulus": 0.1, "locking_stretch": 3.0}),
        "MooneyRivlin": (MooneyRivlin, MooneyRivlin, {"c10": 0.1, "c01": 0.1}),
        "Mullins": (Mullins, Mullins, {"law": NeoHookean(), "r": 2.0, "m": 0.02}),
        "NeoHookean": (NeoHookean, NeoHookean, {}),
        "Ogden": (Ogden, Ogden, {"mu_1": 0.1, "alpha_1": 3.0}),
        "Block": (Block, Block, {"width": 8.0, "depth": 6.0}),
        "Pad": (Pad, Pad, {}),
        "PadFile": (PadFile, PadFile, {"path": "nowhere.stl"}),
        "PadSensor": (sensor, PadSensor, {}),
        "Indenter": (Indenter, Indenter, {"radius": 1.0}),
        "IndenterDisplacement": (IndenterDisplacement, IndenterDisplacement, {"indenter": Indenter(radius=1.0)}),
        "IndenterForce": (IndenterForce, IndenterForce, {"indenter": Indenter(radius=1.0)}),
        "PatchForce": (PatchForce, PatchForce, {"centre": (0, 0), "size": (1, 1)}),
        "PlateWrench": (PlateWrench, PlateWrench, {}),
        "PhotoReflector": (lambda **k: sensor(photo_reflector=PhotoReflector(**k)), PhotoReflector, {}),
        "Phototransistor": (
            lambda **k: sensor(photo_reflector=PhotoReflector(phototransistor=Phototransistor(**k))),
            Phototransistor,
            {},
        ),
        "RandomRoughness": (RandomRoughness, RandomRoughness, {"rms_height": 0.01, "correlation_length": 0.3}),
        "Scene": (lambda **k: Scene(**k).load(), Scene, {"source": "plate.xml"}),
        "Viscoelastic": (Viscoelastic, Viscoelastic, {"law": NeoHookean(), "prony": [(0.2, 1.0)]}),
        "Wall": (lambda **k: sensor(roof=Wall(**k)), Wall, {}),
        "Yeoh": (Yeoh, Yeoh, {"c10": 0.1, "c20": 0.1, "c30": 0.1}),
        "check_scene": (lambda source: check_scene(source), lambda source: None, {}),
        "crosstalk": (crosstalk, crosstalk, {"scene": there["live"], "points": 1}),
        "energy_audit": (energy_audit, energy_audit, {"scene": there["live"], "points": 1}),
        "from_shore_a": (from_shore_a, from_shore_a, {"hardness": 30}),
        "linearise": (linearise, linearise, {}),
        "load_path": (
            load_path,
            load_path,
            {"pad": SMALL, "material": NeoHookean(), "values": [(0, 0, -0.1)], "mesh_size": 2.0},
        ),
        "load_plugins": (lambda file: load_plugins(file), lambda file: None, {}),
        "measure": (measure, measure, {"scene": there["live"], "points": 1}),
        "mesh_velocity": (
            mesh_velocity,
            mesh_velocity,
            {"pad": SMALL, "mesh": there["state"].mesh, "parameter": "wall"},
        ),
        "open_study": (open_study, open_study, {}),
        "read_circuit": (read_circuit, read_circuit, {}),
        "run_study": (run_study, run_study, {"file": "study/study.toml", "output": "study/study.toml"}),
        "show": (show, show, {}),
        "silicone": (silicone, silicone, {}),
        "sweep": (sweep, sweep, {"source": "plate.xml", "vary": {"z": "0.6"}, "points": 1}),
        "tessellate": (tessellate, tessellate, {"state": there["state"], "subdivision": 2}),
        "training_set": (training_set, training_set, {"study": there["study"]}),
        "write_template": (write_template, write_template, {"kind": "scene", "file": "study"}),
        "write_xml": (write_xml, write_xml, {"scene": Scene("plate.xml"), "path": "out.xml"}),
    }


SKIPPED = {
    "workers": [None, 3],  # start processes
    "scheduler": [None, "", "x", "a\0b", "y" * 5000],  # are waited for
    "progress": [int],  # can be called
}


def tried(parameter):
    """Values for a parameter, by their words: arrays are not to be compared."""
    skipped = [repr(value) for value in SKIPPED.get(parameter, [])]
    return [value for value in JUNK if repr(value) not in skipped]


def test_every_public_name_is_tried(there):
    assert {*calls(there)} | WITHOUT_ARGUMENTS | NOT_FOR_CALLERS == set(mitsuba_taxel.__all__)


@pytest.mark.parametrize("name", sorted(set(mitsuba_taxel.__all__) - WITHOUT_ARGUMENTS - NOT_FOR_CALLERS))
@pytest.mark.filterwarnings("ignore")
def test_junk_is_taken_or_refused_in_one_line(there, name):
    function, listed, good = calls(there)[name]
    for parameter in inspect.signature(listed).parameters:
        for value in tried(parameter):
            try:
                function(**{**good, parameter: value})
            except (InputError, ComputationError) as error:
                assert "\n" not in str(error) and 0 < len(str(error)) < 1100, (parameter, value)
            except Exception as error:
                raise AssertionError(f"{name}({parameter}={value!r})") from error
