"""Kinds bring their own parameters to the classes that choose among them."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.kinds import Kind
from mitsuba_taxel.parameters import REQUIRED, Kinded, Number, kind, number, parameters_of, values_of

pytestmark = pytest.mark.quick


class Tip(Kind, family="tip"):
    prefix = "tip_"


class Flat(Tip, name="flat"):
    meaning = "no tip"


class Cone(Tip, name="cone"):
    @classmethod
    def own_parameters(cls) -> Mapping[str, Any]:
        angle = Number(doc="Angle at the tip.", unit="degrees", default=REQUIRED, above=0, maximum=170)
        return {"angle": angle, "length": Number(doc="Length.", unit="mm", default=2.0, above=0)}


class Pyramid(Tip, name="pyramid"):
    @classmethod
    def own_parameters(cls) -> Mapping[str, Any]:
        return {"length": Number(doc="Length.", unit="mm", default=2.0, minimum=1)}


@dataclass(frozen=True)
class Probe(Kinded):
    """As a plugin states it: names are those of a scene."""

    tip: str = kind("flat", Tip, "Tip.")
    width: float = number(1.0, "mm", "Width.", above=0)


@dataclass(frozen=True)
class Rod(Kinded):
    """As an object of Python: names are short."""

    shape: str = kind("flat", Tip, "Tip.", name="tip")


def test_parameters_of_a_kind_are_arguments_attributes_and_parameters():
    probe = Probe("cone", tip_angle=60)
    assert (probe.tip_angle, probe.tip_length, probe.width) == (60.0, 2.0, 1.0)
    assert values_of(probe) == {"tip": "cone", "width": 1.0, "tip_angle": 60.0, "tip_length": 2.0}
    assert replace(probe, tip_angle=30.0).tip_angle == 30.0 and replace(probe, width=2).tip_angle == 60.0
    assert pickle.loads(pickle.dumps(probe)) == probe and hash(probe) == hash(Probe("cone", tip_angle=60.0))
    assert Probe("cone", tip_angle=61) != probe
    assert repr(probe) == "Probe(tip='cone', width=1.0, tip_angle=60.0, tip_length=2.0)" and eval(repr(probe)) == probe
    rod = Rod("cone", angle=60, length=3)
    assert (rod.angle, rod.length) == (60.0, 3.0) and parameters_of(Rod)["angle"].name == "tip_angle"


def test_help_lists_them_among_the_arguments():
    assert str(inspect.signature(Probe)).startswith("(tip:") and "*, tip_angle=None, tip_length=None)" in str(
        inspect.signature(Probe)
    )


def test_those_that_do_not_apply_are_none_or_refused():
    assert Probe().tip_angle is None and Probe(tip_angle=None) == Probe()
    with pytest.raises(InputError, match="tip_angle is not allowed for tip = 'flat', only for 'cone'"):
        Probe(tip_angle=20)
    with pytest.raises(InputError, match="tip_angle is missing"):
        Probe("cone")
    with pytest.raises(InputError, match="tip_angle = 180"):
        Probe("cone", tip_angle=180)
    with pytest.raises(TypeError, match="sharpness"):
        Probe(sharpness=3)
    with pytest.raises(AttributeError, match="sharpness"):
        _ = Probe().sharpness


def test_one_that_kinds_share_applies_to_both_and_states_their_ranges():
    shared = parameters_of(Probe)["tip_length"]
    assert shared.when == ("tip", "cone", "pyramid") and "of at least 1 for `pyramid`" in shared.doc
    assert Probe("pyramid", tip_length=3).tip_length == 3.0


def test_kinds_that_are_defined_later_count():
    class Blade(Tip, name="blade"):
        meaning = "an edge"

        @classmethod
        def own_parameters(cls) -> Mapping[str, Any]:
            return {"edge": Number(doc="Length of the edge.", unit="mm", default=1.0, above=0)}

    try:
        assert Probe("blade", tip_edge=2).tip_edge == 2.0
        assert "`blade` (an edge)" in parameters_of(Probe)["tip"].range
    finally:
        del Tip._registry["blade"]
    with pytest.raises(InputError, match="tip = 'blade' is not allowed: one of flat, cone, pyramid is needed"):
        Probe("blade")


def test_a_parameter_that_the_class_has_already_is_refused():
    class Bare(Kind, family="bare"):
        pass

    class Same(Bare, name="same"):
        @classmethod
        def own_parameters(cls) -> Mapping[str, Any]:
            return {"width": Number(doc="Width.", unit="mm", default=1.0)}

    @dataclass(frozen=True)
    class Bar(Kinded):
        """A bar of a kind."""

        bare: str = kind("same", Bare, "Kind.")
        width: float = number(1.0, "mm", "Width.", above=0)

    with pytest.raises(TypeError, match="bare 'same': width is a parameter of Bar already"):
        Bar()
