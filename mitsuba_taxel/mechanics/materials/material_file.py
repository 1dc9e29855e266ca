"""Materials from TOML files: a law with its constants, the range of the tests behind it, and its source."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.arguments import is_number, path_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.toml import read_toml
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.mullins import Mullins, mullins_of
from mitsuba_taxel.mechanics.materials.viscoelastic import Terms, prony_of

SUFFIX = ".toml"
TEXTS = ("title", "law", "source", "prony", "mullins")
TABLES = ("constants", "intervals", "covariance", "tests", "ranking", "relaxation")
"""Tables of a file; only ``constants`` is needed, the others are for its readers."""


@dataclass(frozen=True, eq=False)
class MeasuredMaterial:
    """A law with its constants from a material file, and where they come from.

    Attributes
    ----------
    law : Material
        Law with its constants.
    source : str
        Origin of the numbers.
    largest_stretch : float or None
        Largest principal stretch of the tests; None if unknown.
    prony : tuple[tuple[float, float], ...]
        Terms of the Prony series: weight, and relaxation time in s; empty for an elastic silicone.
    mullins : Mullins or None
        The law with Mullins' effect; None without the effect.
    title : str
        Name of the material.
    content : Mapping[str, Any]
        The whole file.
    """

    law: Material
    source: str
    largest_stretch: float | None = None
    prony: Terms = ()
    mullins: Mullins | None = None
    title: str = ""
    content: Mapping[str, Any] = field(default_factory=dict, repr=False)


def read_material(file: str | Path) -> MeasuredMaterial:
    """Read a material, such as one that ``taxel material`` has written.

    Parameters
    ----------
    file : str or Path
        TOML file with the entries ``law`` (name of a law), ``source`` and a table ``constants``; optionally
        ``largest_stretch``, ``prony``, and ``mullins``, the constants ``"r m beta"`` of Mullins' effect.

    Returns
    -------
    MeasuredMaterial
        The material, in MPa and s.

    Raises
    ------
    InputError
        if the file cannot be read, or does not describe a material.
    """
    path = path_of("material", file)
    what = f"material {str(file)!r}"
    content = read_toml(what, path)
    for key, value in content.items():
        if key not in (*TEXTS, *TABLES, "largest_stretch", "stable_stretch"):
            allowed = ", ".join((*TEXTS, "largest_stretch", "stable_stretch", *TABLES))
            raise InputError(f"{what}: {key} is not known: allowed are {allowed}.")
        if key in TEXTS and not isinstance(value, str):
            raise InputError(f"{what}: {key} = {value!r} is not allowed: text is needed.")
    for key in ("law", "source", "constants"):
        if key not in content:
            raise InputError(f"{what}: {key} is missing: add it.")
    largest = content.get("largest_stretch")
    if largest is not None and not (is_number(largest) and largest > 1):
        raise InputError(f"{what}: largest_stretch = {largest!r} is not allowed: a number above 1 is needed.")

    # The law checks its constants.
    constants = content["constants"]
    if not isinstance(constants, dict):
        raise InputError(f"{what}: constants = {constants!r} is not allowed: a table [constants] is needed.")
    try:
        law: Any = Material.named(content["law"])
        known = (*law.own_parameters(), "poisson_ratio")
        for name in constants:
            if name not in known:
                raise InputError(f"{name} is not known: constants of {content['law']} are {', '.join(known)}.")
        for name, parameter in law.own_parameters().items():
            if name not in constants and parameter.default is ...:
                raise InputError(f"{name} is missing: {parameter.needed}.")
        material = law(**constants)
        terms = prony_of(content.get("prony", ""))
        mullins = mullins_of(content.get("mullins", ""), material)
        if terms and mullins:
            raise InputError("mullins and prony exclude each other: only one of both is modelled.")
    except InputError as error:
        raise InputError(f"{what}: {error}") from error
    return MeasuredMaterial(
        material, content["source"], largest and float(largest), terms, mullins, content.get("title", ""), content
    )
