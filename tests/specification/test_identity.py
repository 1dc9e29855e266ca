"""What is written to a scene and read from it again is the same, for every plugin; what is refused, Python refuses."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from mitsuba_taxel import InputError, Scene
from mitsuba_taxel.backend import plugin_files, plugin_kind
from mitsuba_taxel.parameters import REQUIRED, Choice, Nested, Number, Switch, Vector, Whole, parameters_of
from mitsuba_taxel.sensing.scene import parser_config
from mitsuba_taxel.specification import specification_of

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
        if any(other and chosen.get(other) is not None for other in (parameter.without, parameter.needs)):
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

    def get(self, name):
        return self.props[name]

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
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.filter_too_much, HealthCheck.too_slow],
)
@given(data=st.data())
def test_scenes_say_what_objects_say(llvm_mono, tmp_path, plugin, data):
    made = data.draw(objects(specification_of(plugin)))
    assert read_again(llvm_mono, made, tmp_path / "scene.xml") == made
