"""What is written to a scene and read from it again is the same, for every plugin; what is refused, Python refuses.

Scenes to start from have the defaults of plugins.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from mitsuba_taxel import (
    AnnularLed,
    InputError,
    Pad,
    PadSensor,
    PhotoReflector,
    Phototransistor,
    Scene,
    Wall,
    write_template,
)
from mitsuba_taxel.backend import plugin_files, plugin_kind
from mitsuba_taxel.mechanics import MooneyRivlin
from mitsuba_taxel.parameters import REQUIRED, Choice, Nested, Number, Switch, Vector, Whole, parameters_of
from mitsuba_taxel.sensing.scene.finding import shipped_scenes
from mitsuba_taxel.sensing.scene.parsing import parser_config
from mitsuba_taxel.specification import specification_of, specifications
from mitsuba_taxel.specification.deformable_pad import DeformablePad

LIMIT = 10.0
FEW = (Choice, Switch)
"""Parameters that are always drawn, as others depend on them; ..."""
SELDOM = st.sampled_from([False, False, False, True])
"""... and whether another is: objects with all of them at random values would nearly all be refused."""


def values(parameter):
    """Values that a parameter may have by itself, or None for its default."""
    if isinstance(parameter, Choice):
        # What is read from files is told by other tests.
        some = st.sampled_from([word for word in parameter.allowed if word != "tabulated"])
    elif isinstance(parameter, Switch):
        some = st.booleans()
    elif isinstance(parameter, Whole):
        some = st.integers(parameter.minimum, min(parameter.maximum, 9))
    elif isinstance(parameter, Number):
        least = max(parameter.minimum, parameter.above, -LIMIT)
        some = st.floats(least, max(least, min(parameter.maximum, LIMIT)), exclude_min=least == parameter.above)
    elif isinstance(parameter, Vector):
        component = st.floats(max(parameter.above, -LIMIT), LIMIT, width=32)  # as Mitsuba has it
        some = st.tuples(component, component, component)
    elif isinstance(parameter, Nested):
        some = objects(parameter.made_of)
    else:
        return st.none()
    return some if parameter.default is REQUIRED else st.one_of(st.none(), some)


@st.composite
def objects(draw, specification):
    """An object of a class with some parameters given, of those that mean anything."""
    chosen: dict = {}
    stated = parameters_of(specification)
    for name, parameter in stated.items():
        word, *allowed = parameter.when or ("",)
        if word and (chosen.get(word) or stated[word].default) not in allowed:
            continue
        if any(other and chosen.get(other) is not None for other in (*parameter.excluded, parameter.needs)):
            continue
        if isinstance(parameter, FEW) or parameter.default is REQUIRED or draw(SELDOM):
            chosen[name] = draw(values(parameter))
    try:
        return specification(**{name: value for name, value in chosen.items() if value is not None})
    except InputError:
        assume(False)


class Parsed:
    """The properties of an object of a scene that is parsed, but not built."""

    def __init__(self, state, node):
        self.props = node.props
        names = [name for name in self.props.keys() if "Reference" in str(self.props.type(name))]
        nested = [(name, Parsed(state, state.nodes[self.props[name].index()])) for name in names]
        self.nested = [(name, child) for name, child in nested if child.props.plugin_name() in plugin_files()]

    def __contains__(self, name):
        return name in self.props

    def __getitem__(self, name):
        return self.props[name]

    def __setitem__(self, name, value):
        self.props[name] = value

    def get(self, name):
        return self.props[name]

    def keys(self):
        return self.props.keys()

    def type(self, name):
        return self.props.type(name)

    def objects(self):
        return self.nested

    @property
    def specification(self):
        return specification_of(self.props.plugin_name()).read(self)


def read_again(mi, made, path):
    """The object that comes of writing one to a scene, and reading that."""
    part = made.to_dict()
    for kind, holder in (("sampler", "phototransistor"), ("emitter", "rectangle"), ("bsdf", "rectangle")):
        if plugin_kind(made.plugin) == kind:
            part = {"type": holder, "part": part}
    if made.plugin == "phototransistor" or made.plugin == "owen_sobol":
        part = {"type": "rectangle", "part": part}
    Scene({"type": "scene", "part": part}).write_xml(path)
    state = mi.parser.parse_file(parser_config(mi.variant()), str(path))
    (found,) = (node for node in state.nodes if node.props.plugin_name() == made.plugin)
    return Parsed(state, found).specification


@pytest.mark.parametrize("plugin", sorted(plugin_files()))
@settings(
    max_examples=12,
    suppress_health_check=[*settings.default.suppress_health_check, HealthCheck.filter_too_much],
)
@given(data=st.data())
def test_scenes_say_what_objects_say(llvm_mono, tmp_path, plugin, data):
    made = data.draw(objects(specification_of(plugin)))
    assert read_again(llvm_mono, made, tmp_path / "scene.xml") == made


@pytest.mark.parametrize(
    "kind, parameters",
    [
        (AnnularLed, {"power": -1.0}),
        (AnnularLed, {"hole": 0.3}),
        (AnnularLed, {"law": "laser"}),
        (AnnularLed, {"law": "lambertian", "cone_angle": 80.0}),
        (AnnularLed, {"law": "tabulated"}),
        (Phototransistor, {"exponent": 2.0}),
        (Wall, {"scattering": "absorbing", "reflectance": 1.0}),
        (Wall, {"scattering": "mixed", "specular": 0.5}),
        (Wall, {"reflectance": 0.5, "reflectance_table": "paint.csv"}),
        (PhotoReflector, {"rows": 1001}),
        (PhotoReflector, {"spacing": 1.0}),
        (DeformablePad, {"cell": "round"}),
        (DeformablePad, {"pitch": 2.5}),
        (DeformablePad, {"material": "yeoh"}),
        (DeformablePad, {"pressure": 1.0}),
        (DeformablePad, {"read_cells": "one"}),
        (DeformablePad, {"finish": "grooves", "groove_pitch": 0.1, "groove_depth": 0.1, "groove_direction": [0, 0, 0]}),
        (DeformablePad, {"finish": "layer_steps", "layer_height": 0.1, "layer_offset": 0.2}),
        (DeformablePad, {"finish": "layer_steps", "roof_finish": "smooth", "side_finish": "smooth"}),
        (DeformablePad, {"side_finish": "grooves", "layer_height": 0.1}),
        (DeformablePad, {"finish": "layer_steps", "layer_height": 0.1, "side_finish": "random", "rms_height": 0.01}),
    ],
)
def test_python_refuses_in_the_words_of_the_plugin(llvm_mono, kind, parameters):
    with pytest.raises(InputError) as here:
        kind(**parameters)
    part = {"type": kind.plugin, **parameters}
    if kind is PhotoReflector:
        part.update(led=AnnularLed().to_dict(), sensor=Phototransistor().to_dict())
    elif kind is not DeformablePad:
        part = {"type": "rectangle", "part": part}
    with pytest.raises(InputError, match=f"^{re.escape(str(here.value))}$"):
        Scene({"type": "scene", "part": part}).load()


@pytest.mark.parametrize(
    "parts, message",
    [
        ({"photo_reflector": PhotoReflector(led=AnnularLed(size=0.5))}, None),
        ({"pad": Pad(cell_size=0.2, pitch=1.0)}, "pitch = 1 is not allowed: at least 1.46 is needed"),
        ({"force": (1.0, 2.0)}, r"force = \(1.0, 2.0\) is not allowed: 3 numbers are needed"),
    ],
)
def test_a_sensor_refuses_parts_that_do_not_go_together(parts, message):
    if message is None:
        PadSensor(**parts)
        return
    with pytest.raises(InputError, match=message):
        PadSensor(**parts)


def test_constants_for_which_the_energy_falls_are_refused_with_the_reason():
    with pytest.raises(InputError, match="c01 = -1.0 is not allowed: .* whose stress rises up to a principal stretch"):
        MooneyRivlin(1.0, -1.0)


@pytest.fixture(params=["hexagonal.xml", "pad.xml", "template"])
def scene(request, tmp_path):
    if request.param != "template":
        return shipped_scenes() / request.param
    write_template("scene", tmp_path / "scene.xml")
    return tmp_path / "scene.xml"


def test_numbers_of_scenes_to_start_from_are_those_of_the_plugins(scene):
    root = ElementTree.parse(scene).getroot()
    allowed: dict[str, set[float]] = {}
    for element in root.iter():
        stated = specifications().get(element.get("type", ""))
        for child in element if stated is not None else ():
            parameter = stated.values().get(child.get("name"))
            stands_alone = isinstance(parameter, Number | Whole) and child.get("value", "").startswith("$")
            if stands_alone and parameter.default is not None:  # Poisson's ratio is that of the silicone
                allowed.setdefault(child.get("value")[1:], set()).add(parameter.default)
    assert "youngs_modulus" in allowed
    given = {element.get("name"): element.get("value") for element in root.iter("default")}
    for name, defaults in allowed.items():
        assert float(given[name]) in defaults, name


BOTH = '<emitter type="annular_led"/> <sensor type="phototransistor"/>'
LED = '<emitter type="annular_led">{}</emitter>'

SENSOR = '<sensor type="phototransistor">{}</sensor>'

MIXED = '<bsdf type="wall"> <string name="scattering" value="mixed"/>{}</bsdf>'

ROUGH = '<bsdf type="wall"> <string name="scattering" value="rough_mirror"/>{}</bsdf>'


@pytest.mark.parametrize(
    "xml, message",
    [
        ('<bsdf type="wall"> <float name="reflectance" value="1.01"/> </bsdf>', "reflectance = 1.01"),
        ('<bsdf type="wall"> <float name="reflectance" value="nan"/> </bsdf>', "reflectance = nan"),
        ('<bsdf type="wall"> <string name="scattering" value="shiny"/> </bsdf>', "scattering = 'shiny'"),
        (
            '<bsdf type="wall"> <string name="scattering" value="absorbing"/>'
            '<float name="reflectance" value="1"/> </bsdf>',
            "reflectance is not allowed",
        ),
        ('<bsdf type="wall"> <float name="reflectence" value="1"/> </bsdf>', "reflectence"),
        (
            MIXED.format('<float name="specular" value="0.5"/> <float name="isotropic" value="0.4"/>'),
            "specular = 0.5, lambertian = 0, isotropic = 0.4 are not allowed: their sum is 0.9 ",
        ),
        (MIXED.format(""), "their sum is 0 "),
        (
            MIXED.format('<float name="specular" value="-0.5"/> <float name="isotropic" value="1"/>'),
            "specular = -0.5 is not allowed",
        ),
        (
            '<bsdf type="wall"> <float name="specular" value="1"/> </bsdf>',
            "specular is not allowed .* only for 'mixed'",
        ),
        (MIXED.format('<float name="rms_slope" value="1"/>'), "rms_slope is not allowed .* only for 'rough_mirror'"),
        (ROUGH.format(""), "rms_slope is missing: a number from 0.01 to 45"),
        (ROUGH.format('<float name="rms_slope" value="0"/>'), "rms_slope = 0 is not allowed"),
        (ROUGH.format('<float name="rms_slope" value="46"/>'), "rms_slope = 46 is not allowed"),
        (ROUGH.format('<float name="rms_slope" value="0.005"/>'), "rms_slope = 0.005 .* from 0.01 to 45 .* 'mirror'"),
        (
            '<bsdf type="wall"> <string name="reflectance_table" value="a.csv"/> <float name="reflectance" value="1"/>'
            "</bsdf>",
            "reflectance and reflectance_table exclude each other",
        ),
        (
            '<bsdf type="wall"> <string name="scattering" value="absorbing"/>'
            '<string name="reflectance_table" value="a.csv"/> </bsdf>',
            "reflectance_table is not allowed for scattering = 'absorbing'",
        ),
        (
            '<bsdf type="wall"> <string name="reflectance_table" value="no/such.csv"/> </bsdf>',
            "reflectance_table = 'no/such.csv' cannot be read",
        ),
        (
            '<bsdf type="wall"> <float name="reflectance_table" value="0.5"/> </bsdf>',
            "reflectance_table = 0.5 is not allowed: the name of a CSV file",
        ),
        ('<bsdf type="region"/>', "it has no BSDF"),
        (
            '<bsdf type="region"> <bsdf name="ceiling" type="wall"/> </bsdf>',
            "'ceiling' is not a region: allowed are roof, .* phototransistor",
        ),
        (
            f'<shape type="photo_reflector"> {BOTH} <bsdf type="region"> <bsdf name="lid" type="wall"/> </bsdf>'
            "</shape>",
            "'lid' is not a region",
        ),
        (LED.format('<float name="power" value="-1"/>'), "power = -1"),
        (LED.format('<float name="power" value="inf"/>'), "power = inf"),
        (LED.format('<float name="hole" value="0.25"/>'), "hole = 0.25"),
        (LED.format('<float name="cone_angle" value="91"/>'), "cone_angle = 91"),
        (LED.format('<string name="law" value="laser"/>'), "law = 'laser'"),
        (
            LED.format('<string name="law" value="lambertian"/> <float name="cone_angle" value="80"/>'),
            "cone_angle is not allowed for law = 'lambertian', only for 'uniform_solid_angle', 'uniform_polar_angle'",
        ),
        (SENSOR.format('<float name="width" value="0"/>'), "width = 0"),
        (SENSOR.format('<film type="hdrfilm"/>'), "rfilter must be a box"),
        ('<shape type="photo_reflector"/>', "exactly one annular_led"),
        (f'<shape type="photo_reflector">{LED.format("")}</shape>', "exactly one phototransistor"),
        (
            f'<shape type="photo_reflector"> <float name="spacing" value="1"/> {BOTH} </shape>',
            "spacing = 1 is not allowed: from 0.385 .* to 0.94",
        ),
        (
            '<shape type="photo_reflector">'
            + LED.format("")
            + SENSOR.format('<float name="width" value="9"/>')
            + "</shape>",
            "width = 9 of the phototransistor is not allowed: side by side, .* need a body of x extent 13.6",
        ),
        (
            f'<shape type="photo_reflector"> <float name="spacing" value="0.3"/> {BOTH} </shape>',
            "spacing = 0.3",
        ),
        (
            '<shape type="photo_reflector"> <integer name="rows" value="2"/> <float name="pitch" value="1"/>'
            f"{BOTH} </shape>",
            "pitch = 1 is not allowed: at least 1.06",
        ),
        (
            f'<shape type="photo_reflector"> <transform name="to_world"> <scale x="2"/> </transform>{BOTH} </shape>',
            "to_world must be a rigid motion",
        ),
        ('<shape type="deformable_pad"> <string name="cell" value="round"/> </shape>', "cell = 'round'"),
        ('<shape type="deformable_pad"> <float name="youngs_modulus" value="-4"/> </shape>', "youngs_modulus = -4"),
        ('<shape type="deformable_pad"> <float name="poisson_ratio" value="0.51"/> </shape>', "poisson_ratio = 0.51"),
        ('<shape type="deformable_pad"> <vector name="force" value="0, 0, nan"/> </shape>', "force = "),
        ('<shape type="deformable_pad"> <float name="cell_height" value="4.6"/> </shape>', "break through the top"),
        ('<shape type="deformable_pad"> <float name="pitch" value="2.5"/> </shape>', "the cells overlap"),
        ('<shape type="deformable_pad"> <float name="mesh_size" value="0"/> </shape>', "mesh_size = 0"),
        ('<shape type="deformable_pad"> <integer name="subdivision" value="0"/> </shape>', "subdivision = 0"),
        ('<shape type="deformable_pad"> <string name="finish" value="rusty"/> </shape>', "finish = 'rusty'"),
        ('<shape type="deformable_pad"> <float name="layer_height" value="0.1"/> </shape>', "layer_height"),
        (
            '<shape type="deformable_pad"> <string name="finish" value="grooves"/> </shape>',
            "groove_pitch is missing",
        ),
        (
            '<shape type="deformable_pad"> <string name="finish" value="layer_steps"/>'
            '<float name="layer_height" value="0.1"/> <vector name="print_direction" value="0, 0, 0"/> </shape>',
            "print_direction = ",
        ),
        (
            '<shape type="deformable_pad"> <string name="finish" value="layer_steps"/>'
            '<float name="layer_height" value="0.1"/> <float name="rms_height" value="0.1"/> </shape>',
            "rms_height",
        ),
        (
            '<shape type="deformable_pad"> <string name="finish" value="random"/> <float name="rms_height" value="1"/>'
            '<float name="correlation_length" value="1"/> </shape>',
            "rms_height = 1 is not allowed: walls of the cells would move",
        ),
        (
            '<shape type="deformable_pad"> <string name="finish" value="layer_steps"/>'
            '<float name="layer_height" value="0.001"/> </shape>',
            "layer_height = 0.001 .* triangles",
        ),
        ('<integrator type="taxel_tracer"> <integer name="max_depth" value="-2"/> </integrator>', "max_depth = -2"),
        ('<integrator type="taxel_tracer"> <string name="strategy" value="luck"/> </integrator>', "strategy = 'luck'"),
        ('<sampler type="owen_sobol"> <integer name="sample_count" value="0"/> </sampler>', "sample_count = 0"),
    ],
)
def test_bad_parameters_are_refused_in_one_line(llvm_mono, tmp_path, xml, message):
    path = tmp_path / "scene.xml"
    kind = xml.split(" ")[0][1:]
    if kind in ("emitter", "sensor"):
        xml = f'<shape type="rectangle">{xml}</shape>'
    if kind == "sampler":
        xml = f'<shape type="rectangle"> <sensor type="phototransistor">{xml}</sensor> </shape>'
    path.write_text(f'<scene version="3.9.0">{xml}</scene>')
    with pytest.raises(InputError, match=message) as caught:
        Scene.from_file(path).load()
    assert "\n" not in str(caught.value)
