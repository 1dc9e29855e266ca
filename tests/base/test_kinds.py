"""Kinds register under their names; what one lacks, or a name that is taken, fails when it is defined."""

from __future__ import annotations

import inspect
import sys
from abc import abstractmethod
from typing import ClassVar

import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.kinds import Kind

pytestmark = pytest.mark.quick


class Section(Kind, family="section"):
    sides: ClassVar[int]

    @abstractmethod
    def area(self) -> float: ...

    @property
    @abstractmethod
    def perimeter(self) -> float: ...


class Square(Section, name="square", rank=2):
    sides = 4

    def area(self) -> float:
        return 1.0

    perimeter = 4.0


class Shared(Section):
    """A step between the family and its kinds."""

    sides = 3

    def area(self) -> float:
        return 0.5


class Triangle(Shared, name="triangle", rank=1):
    perimeter = 3.0


class Other(Kind, family="other"):
    pass


def test_kinds_are_found_by_name_in_the_order_of_their_ranks():
    assert list(Section.kinds()) == ["triangle", "square"]
    assert Section.named("square") is Square
    assert (Triangle.name, Triangle.family, Triangle().sides) == ("triangle", "section", 3)
    assert not Other.kinds()


def test_all_that_a_kind_lacks_is_named_when_it_is_defined():
    with pytest.raises(TypeError, match="section 'round': .*Round lacks area, perimeter, sides"):

        class Round(Section, name="round"):
            pass

    assert "round" not in Section.kinds()


def test_there_are_no_objects_of_incomplete_classes():
    """A subclass without a name, such as a user's own law, is an abstract class until it defines all methods."""

    class Partial(Section):
        def area(self) -> float:
            return 2.0

    class Whole(Partial):
        perimeter = 6.0

    for incomplete in (Section, Partial):
        assert inspect.isabstract(incomplete)
        with pytest.raises(TypeError, match="abstract .*perimeter"):
            incomplete()
    assert not inspect.isabstract(Whole) and Whole().area() == 2.0


DEFERRED = """
from typing import TYPE_CHECKING, ClassVar
from mitsuba_taxel.base.kinds import Kind
if TYPE_CHECKING:
    from nowhere import Thing

class Deferred(Kind, family="deferred"):
    sides: ClassVar[int]
    thing: Thing | None = None

class Right(Deferred, name="right"):
    sides = 4

class Wrong(Deferred, name="wrong"):
    pass
"""


@pytest.mark.skipif(sys.version_info < (3, 14), reason="this Python evaluates annotations at once")
def test_annotations_may_name_what_only_type_checkers_import():
    code = compile(DEFERRED, "deferred.py", "exec", dont_inherit=True)
    with pytest.raises(TypeError, match="deferred 'wrong': Wrong lacks sides"):
        exec(code, {"__name__": "deferred"})


def test_a_name_that_is_taken_is_refused():
    with pytest.raises(TypeError, match="section 'square' exists already: .*Square"):

        class Square4(Shared, name="square"):
            perimeter = 4.0

    assert Section.named("square") is Square


def test_an_unknown_name_is_refused_with_those_that_there_are():
    with pytest.raises(InputError, match=r"section = 'squar' .*triangle, square is needed \(did you mean square\?\)"):
        Section.named("squar")


def test_the_same_class_defined_again_replaces_itself():
    before = Section.named("triangle")
    try:
        namespace = {"__module__": __name__, "__qualname__": "Triangle", "perimeter": 3.5}
        again = type(Section)("Triangle", (Shared,), namespace, name="triangle", rank=1)
        assert Section.named("triangle") is again
    finally:
        Section._registry["triangle"] = (1, before)
