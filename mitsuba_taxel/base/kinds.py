"""Families of kinds, such as cell shapes or material laws: a new kind is a class; missing members are reported when the
class is defined."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterable, Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

from mitsuba_taxel.base.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from typing_extensions import Self

LAST = 1000
"""Rank of kinds without a rank: they are last in lists."""


class _Registry(dict[str, tuple[int, type[Any]]]):
    """The kinds of a family with their ranks, by name; changes of all registries are counted."""

    changes: ClassVar[int] = 0

    def __setitem__(self, name: str, entry: tuple[int, type[Any]]) -> None:
        super().__setitem__(name, entry)
        _Registry.changes += 1

    def __delitem__(self, name: str) -> None:
        super().__delitem__(name)
        _Registry.changes += 1


def changes_of_kinds() -> int:
    """Number of changes of all families so far; while it stays the same, so do their kinds.

    Returns
    -------
    int
        Number of kinds that were defined or removed.
    """
    return _Registry.changes


class Kind:
    """Base of families of kinds.

    A family is a subclass with ``family=``, the name of the parameter that selects its kinds. A kind is a subclass of a
    family with ``name=``, the value of that parameter, and optionally ``rank=``, its position in lists. A subclass with
    neither is an intermediate base class of several kinds.

    A kind must define every abstract method of its family, and every ``ClassVar`` that the family annotates without a
    value.

    Attributes
    ----------
    name : str
        Name of a kind in a scene.
    meaning : str
        Meaning of the name of a kind, in a few words for lists; empty if it is obvious.
    uses : tuple[str, ...]
        Names of the attributes of shared parameters that this kind uses. Several kinds of the family share them.
    prefix : str
        Prefix of the names of a family's parameters in a scene, such as ``indenter_``.

    Raises
    ------
    TypeError
        when a kind is defined that lacks a member, or that has the name of another kind of the family.

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

    _registry: ClassVar[_Registry]

    def __init_subclass__(cls, /, family: str = "", name: str = "", rank: int = LAST, **others: Any) -> None:
        super().__init_subclass__(**others)
        # As in ABCMeta, a class with abstract methods cannot be instantiated; ABCMeta of Python 3.10 refuses ``name=``.
        cls.__abstractmethods__ = frozenset(_abstract_methods(cls))  # type: ignore[attr-defined]
        if family:
            cls.family, cls._registry = family, _Registry()
        if not name:
            return
        if missing := _missing_members(cls):
            raise TypeError(f"{cls.family} {name!r}: {cls.__qualname__} lacks {', '.join(missing)}.")
        existing = cls._registry.get(name, (0, cls))[1]
        if (existing.__module__, existing.__qualname__) != (cls.__module__, cls.__qualname__):
            raise TypeError(f"{cls.family} {name!r} exists already: {existing.__module__}.{existing.__qualname__}.")
        cls.name = name
        cls._registry[name] = (rank, cls)

    @classmethod
    def own_parameters(cls) -> Mapping[str, Any]:
        """Parameters (`Parameter`) that only this kind has, by attribute."""
        return MappingProxyType({})

    @classmethod
    def kinds(cls) -> Mapping[str, type[Self]]:
        """The kinds of the family by their names, in the order of their ranks."""
        # Sorting is stable: kinds of equal rank are in the order of their definition.
        ordered = sorted(cls._registry.items(), key=lambda entry: entry[1][0])
        return MappingProxyType({name: kind for name, (_, kind) in ordered})

    @classmethod
    def named(cls, name: str) -> type[Self]:
        """The kind (class) with a given name; raises `InputError` if the family has no such kind."""
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
        ``__path__`` of the package.
    """
    for module in iter_modules(path):
        import_module(f"{package}.{module.name}")


def _abstract_methods(cls: type) -> set[str]:
    # Attributes are looked up without evaluation, as annotations may contain names that are not imported.
    members = ((name, inspect.getattr_static(cls, name, None)) for name in dir(cls))
    return {name for name, member in members if getattr(member, "__isabstractmethod__", False)}


def _missing_members(cls: type) -> list[str]:
    """Names of abstract methods, and of annotated class variables, that a class does not define."""
    annotated = {
        name
        for base in cls.__mro__
        for name, annotation in annotations_of(base).items()
        if "ClassVar" in annotation and not name.startswith("_") and not hasattr(cls, name)
    }
    return sorted(_abstract_methods(cls) | annotated)


def annotations_of(class_: type) -> dict[str, str]:
    """Source text of the annotations of a class, without those of its base classes.

    Python 3.14 evaluates annotations when they are read, which fails for names that only type checkers import. The
    source text of annotations is therefore returned in every version.

    Parameters
    ----------
    class_ : type
        Any class.

    Returns
    -------
    dict[str, str]
        The annotations as text, by name.
    """
    if sys.version_info >= (3, 14):
        from annotationlib import Format, get_annotations

        return get_annotations(class_, format=Format.STRING)
    return {name: str(annotation) for name, annotation in inspect.get_annotations(class_).items()}
