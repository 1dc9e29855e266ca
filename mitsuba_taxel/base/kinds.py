"""Families of kinds, such as cell shapes or material laws: a new kind is one class, and what it lacks fails at once."""

from __future__ import annotations

import inspect
from abc import ABC
from collections.abc import Iterable, Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.spelling import did_you_mean

if TYPE_CHECKING:
    from typing import Self

LAST = 1000
"""Rank of kinds that state none: they follow the others in lists."""


class Kind(ABC):
    """Base of families of kinds.

    A family is a subclass with ``family=``, the name of the parameter that chooses among its kinds. A kind is a
    subclass of a family with ``name=``, the value of that parameter, and perhaps ``rank=``, its position in lists. A
    subclass with neither is a step between the two: kinds share it.

    A kind must define every abstract method of its family, and every ``ClassVar`` that the family annotates without a
    value.

    Attributes
    ----------
    name : str
        Of a kind, as in a scene.
    meaning : str
        Of its name, in a few words for lists; empty if that is obvious.
    uses : tuple[str, ...]
        Of a kind, those of the parameters that are stated for several kinds which it has, by attribute.
    prefix : str
        Of a family, of the names of its own parameters in a scene, such as ``indenter_``.

    Raises
    ------
    TypeError
        When a kind is defined, if it lacks a member, or if another kind of the family has its name.

    Examples
    --------
    >>> class Section(Kind, family="section"):
    ...     sides: ClassVar[int]
    >>> class Square(Section, name="square"):
    ...     sides = 4
    >>> Section.named("square").sides
    4
    """

    family: ClassVar[str] = ""
    name: ClassVar[str] = ""
    meaning: ClassVar[str] = ""
    uses: ClassVar[tuple[str, ...]] = ()
    prefix: ClassVar[str] = ""

    _registry: ClassVar[dict[str, tuple[int, type[Any]]]]

    def __init_subclass__(cls, /, family: str = "", name: str = "", rank: int = LAST, **others: Any) -> None:
        super().__init_subclass__(**others)
        if family:
            cls.family, cls._registry = family, {}
        if not name:
            return
        if missing := _missing_members(cls):
            raise TypeError(f"{cls.family} {name!r}: {cls.__qualname__} lacks {', '.join(missing)}.")
        known = cls._registry.get(name, (0, cls))[1]
        if (known.__module__, known.__qualname__) != (cls.__module__, cls.__qualname__):
            raise TypeError(f"{cls.family} {name!r} exists already: {known.__module__}.{known.__qualname__}.")
        cls.name = name
        cls._registry[name] = (rank, cls)

    @classmethod
    def own_parameters(cls) -> Mapping[str, Any]:
        """Parameters (`Parameter`) that only kinds such as this one have, by attribute."""
        return MappingProxyType({})

    @classmethod
    def kinds(cls) -> Mapping[str, type[Self]]:
        """The kinds of the family by their names, in the order of their ranks."""
        ordered = sorted(
            cls._registry.items(), key=lambda entry: entry[1][0]
        )  # stable: then in the order of definition
        return MappingProxyType({name: kind for name, (_, kind) in ordered})

    @classmethod
    def named(cls, name: str) -> type[Self]:
        """The kind of a name.

        Raises
        ------
        InputError
            If the family has no such kind.
        """
        if not isinstance(name, str) or name not in cls._registry:
            kinds = cls.kinds()
            hint = did_you_mean(name, kinds) if isinstance(name, str) else ""
            raise InputError(f"{cls.family} = {name!r} is not allowed: one of {', '.join(kinds)} is needed{hint}.")
        return cls._registry[name][1]


def import_all(package: str, path: Iterable[str]) -> None:
    """Import every module of a package, so that the kinds in them are registered.

    Parameters
    ----------
    package : str
        ``__name__`` of the package.
    path : iterable of str
        Its ``__path__``.
    """
    for module in iter_modules(path):
        import_module(f"{package}.{module.name}")


def _missing_members(cls: type) -> list[str]:
    """Names of abstract methods, and of annotated class variables, that a class does not define."""
    # ABCMeta collects abstract methods only after the class is made, so they are looked up one by one.
    abstract = {name for name in dir(cls) if getattr(getattr(cls, name, None), "__isabstractmethod__", False)}
    annotated = {
        name
        for base in cls.__mro__
        for name, annotation in inspect.get_annotations(base).items()
        if "ClassVar" in str(annotation) and not name.startswith("_") and not hasattr(cls, name)
    }
    return sorted(abstract | annotated)
