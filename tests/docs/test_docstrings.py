"""Docstrings of what the reference publishes, and of what rooms import of each other, by numpydoc's validation."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from numpydoc.validate import validate
from public_names import directives, resolved

ROOT = Path(__file__).parents[2]
CODES = {"GL06", "GL07", "PR01", "PR02", "PR03", "PR04", "PR07", "RT01", "RT03", "YD01"}
"""Sections that are unknown or out of order; parameters, returned and yielded values that lack a name, a type or a
description."""
FROM = re.compile(r"^ *from mitsuba_taxel\.(\w+)\.?([\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
"""Imports of other modules: their room, the rest of their name, and what is imported, with comments."""
RAISING = {"InputError", "ComputationError", "refusal"}
"""What functions raise that have to say so."""


def published() -> Iterator[Any]:
    """Functions of the page, and methods of its classes that have a docstring."""
    for kind, _, value, options in directives():
        if kind == "function":
            yield inspect.unwrap(value)
        if kind != "class" or ":members:" not in options:
            continue
        wanted, left_out = (
            set(re.findall(r"\w+", "".join(re.findall(rf":{option}:(.*)", options))))
            for option in ("members", "exclude-members")
        )
        for attribute in vars(value).keys() - left_out:
            member = getattr(value, attribute)
            member = inspect.unwrap(getattr(member, "__func__", member))
            public = attribute in wanted if wanted else attribute[0] != "_"
            if public and inspect.isfunction(member) and member.__doc__:
                yield member


def shared() -> Iterator[Any]:
    """Functions that a room imports from another one; those of the evidence are read by nobody else."""
    for file in sorted((ROOT / "mitsuba_taxel").rglob("*.py")):
        room = file.relative_to(ROOT / "mitsuba_taxel").parts[0]
        for of, rest, imported in FROM.findall(file.read_text()):
            if of in (room, "evidence", "plugins"):
                continue
            for name in re.findall(r"\w+", re.sub(r"#.*|\bas \w+", "", imported)):
                value = inspect.unwrap(resolved(".".join(filter(None, ("mitsuba_taxel", of, rest, name)))))
                if inspect.isfunction(value) and value.__doc__:
                    yield value


def fields_of(value: type) -> set[str]:
    """Of a dataclass or a named tuple; no class else has any."""
    if is_dataclass(value):
        return {field.name for field in fields(value)}
    return set(getattr(value, "_fields", ()))


def described(value: type) -> set[str]:
    """Fields of a class that its docstring, or one below them, describes; those of its bases as well."""
    names: set[str] = set()
    for base in value.__mro__[:-1]:
        if base.__module__.partition(".")[0] != "mitsuba_taxel":
            continue
        for heading in re.findall(r"^(\w+(?:, \w+)*)(?: : .*)?$", inspect.getdoc(base) or "", re.MULTILINE):
            names.update(heading.split(", "))
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        assert isinstance(tree, ast.ClassDef)
        for field, below in zip(tree.body, tree.body[1:], strict=False):
            if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr) and isinstance(field.target, ast.Name):
                names.add(field.target.id)
    return names


def problems(function: Any) -> Iterator[str]:
    """What numpydoc finds, and errors that are raised without being named."""
    name = f"{function.__module__}.{function.__qualname__}"
    yield from (f"{name}: {code} {text}" for code, text in validate(name)["errors"] if code in CODES)
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    raised = {
        node.exc.func.id
        for node in ast.walk(tree)
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and isinstance(node.exc.func, ast.Name)
    }
    if raised & RAISING and "Raises\n" not in (function.__doc__ or ""):
        yield f"{name}: no Raises section"


def test_published_functions_state_what_goes_in_and_out():
    functions = {f"{function.__module__}.{function.__qualname__}": function for function in published()}
    assert len(functions) > 120
    assert [problem for function in functions.values() for problem in problems(function)] == []


def test_functions_that_other_rooms_call_state_what_goes_in_and_out():
    functions = {f"{function.__module__}.{function.__qualname__}": function for function in shared()}
    assert len(functions) > 350
    assert [problem for function in functions.values() for problem in problems(function)] == []


def test_fields_of_published_classes_are_described():
    """Below the field, or in the docstring under Parameters or Attributes."""
    classes = [value for kind, _, value, _ in directives() if kind == "class"]
    lacking = {value.__name__: fields_of(value) - described(value) for value in classes}
    assert len(classes) > 50
    assert {name: fields for name, fields in lacking.items() if fields} == {}
