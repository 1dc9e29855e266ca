"""What the parameters of a study are, from their use in its scene, whatever they are called."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.units import FORCES, LOADS, TIME


def roles_of_study(study: xr.Dataset) -> dict[str, str]:
    """What each parameter is, by name: a role of `roles_of_parameters`.

    Studies without a scene, made of numbers, have parameters that are what they are called.

    Parameters
    ----------
    study : xr.Dataset
        Of one scene.

    Returns
    -------
    dict[str, str]
        Roles by the name of the parameter.
    """
    if "roles" not in study.attrs:
        return {str(name): str(name) for name in study.coords}
    stated = {**json.loads(study.attrs["roles"]), **json.loads(study.attrs.get("forces", "{}"))}
    plain = {} if "forces" in study.attrs else {name: name for name in FORCES}  # named so already
    return {**{name: role for name, (role, _) in stated.items()}, **plain}


def force_parameters(study: xr.Dataset | xr.DataTree) -> list[str]:
    """Parameters of a study's scenes that are a component of the force, varied or not.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        As returned by ``open_study``.

    Returns
    -------
    list[str]
        What they would be called where there are none.
    """
    found: dict[str, None] = {}
    for each in study.subtree if isinstance(study, xr.DataTree) else [study]:
        names = {*json.loads(each.attrs.get("parameters", "{}")), *map(str, each.dims), *map(str, each.coords)}
        found |= dict.fromkeys(name for name in json.loads(each.attrs.get("forces", "{}")) if name in names)
    return list(found or FORCES)


def is_load(study: xr.Dataset, name: str) -> bool:
    """Whether a parameter of a study is a component of the force or displacement, or the pressure.

    Parameters
    ----------
    study : xr.Dataset
        Of one scene.
    name : str
        Of the parameter.

    Returns
    -------
    bool
        False for an unknown one.
    """
    return _is_load(roles_of_study(study).get(name, ""))


def _is_load(role: str) -> bool:
    return any(role in names for names in LOADS)


def with_forces_named(study: xr.Dataset) -> xr.Dataset:
    """A study in which the components of the force are called ``fx``, ``fy`` and ``fz``, and have their sign, and the
    time of the load ``time``.

    What they were called is in the attributes ``forces`` and ``roles``, from the scene, which the result does not have.
    Other parameters of these names are called ``parameter fz``, unless the scene has no parameter for a load: its names
    are all that says what it is, then.

    Parameters
    ----------
    study : xr.Dataset
        Of one scene.

    Returns
    -------
    xr.Dataset
        The study itself if it has been renamed already.
    """
    if "forces" not in study.attrs:
        return study
    forces = {name: tuple(role) for name, role in json.loads(study.attrs["forces"]).items()}
    stated = json.loads(study.attrs.get("roles", "{}"))
    times = [name for name, (role, sign) in stated.items() if role == TIME and sign > 0]
    parameters = json.loads(study.attrs.get("parameters", "{}"))
    names = {*map(str, study.coords), *map(str, study.dims), *parameters}
    new = {name: component for name, (component, _) in forces.items()} | dict.fromkeys(times, TIME)
    loads = [name for name, (role, _) in {**stated, **forces}.items() if name in names and _is_load(role)]
    taken = {name for name in (*FORCES, *([TIME] if "roles" in study.attrs else [])) if loads and name in names}
    taken -= new.keys()
    new = {name: role for name, role in new.items() if name in names} | {name: f"parameter {name}" for name in taken}
    signs = {name: sign for name, (_, sign) in forces.items() if name in new}
    study = study.assign_attrs({name: value for name, value in study.attrs.items() if name != "forces"})
    study.attrs.pop("forces", None)
    for name, sign in signs.items():
        if sign < 0 and name in study.coords:
            study = study.assign_coords({name: (study[name].dims, -study[name].values + 0.0, study[name].attrs)})
    if "parameter" in study.coords:
        by = study.parameter.values.tolist()
        factors = xr.DataArray(
            [float(signs.get(name, 1)) for name in by], dims="parameter", coords={"parameter": study.parameter}
        )
        if "derivative" in study:
            derivative = study.derivative
            made = (derivative * factors).transpose(*derivative.dims).assign_attrs(derivative.attrs)
            study = study.assign(derivative=made)
        study = study.assign_coords(parameter=np.array([new.get(name, name) for name in by]))
    for group in (taken, new.keys() - taken):  # the names of the second are free then
        study = study.rename({name: new[name] for name in group if name in study.coords or name in study.dims})
    values = {name: _negative(word) if signs.get(name, 1) < 0 else word for name, word in parameters.items()}
    tables: dict[str, Mapping[str, Any]] = {"parameters": values}
    tables |= {name: json.loads(study.attrs[name]) for name in ("units", "roles") if name in study.attrs}
    for title, table in tables.items():
        study.attrs[title] = json.dumps({new.get(name, name): value for name, value in table.items()})
    study.attrs["curve"] = new.get(study.attrs.get("curve", ""), study.attrs.get("curve", ""))
    return study


def _negative(word: str) -> str:
    """Minus a number, in words."""
    return f"{-float(word) + 0.0:.12g}"
