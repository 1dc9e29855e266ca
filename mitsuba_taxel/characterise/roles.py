"""Roles of a study's parameters (force component, time, ...), taken from their use in its scene, not their name."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.units import FORCES, LOADS, TIME


def roles_of_study(study: xr.Dataset) -> dict[str, str]:
    """Role of each parameter of a study: the plugin parameter that the scene sets with it (see `roles_of_parameters`).

    A role is, for example, ``fz``, ``time`` or ``indenter_x``. In a study that was built from numbers, without a scene,
    the role of a parameter is its name.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene.

    Returns
    -------
    dict[str, str]
        Roles by name of the parameter.
    """
    if "roles" not in study.attrs:
        return {str(name): str(name) for name in study.coords}
    recorded = {**json.loads(study.attrs["roles"]), **json.loads(study.attrs.get("forces", "{}"))}
    default = {} if "forces" in study.attrs else {name: name for name in FORCES}
    return {**{name: role for name, (role, _) in recorded.items()}, **default}


def force_parameters(study: xr.Dataset | xr.DataTree) -> list[str]:
    """Names of the scene parameters that set a component of the force, whether the study varies them or not.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        Result of ``open_study``.

    Returns
    -------
    list[str]
        Names; ``fx``, ``fy`` and ``fz`` if the scenes have no such parameter.
    """
    names: dict[str, None] = {}
    for scene in study.subtree if isinstance(study, xr.DataTree) else [study]:
        scene_parameters = {
            *json.loads(scene.attrs.get("parameters", "{}")),
            *map(str, scene.dims),
            *map(str, scene.coords),
        }
        names |= dict.fromkeys(name for name in json.loads(scene.attrs.get("forces", "{}")) if name in scene_parameters)
    return list(names or FORCES)


def forces_by_parameter(study: xr.Dataset | xr.DataTree) -> dict[str, str]:
    """Components of the force in terms of the parameters of the scenes, such as ``-push`` for ``fz``.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        Result of ``open_study``.

    Returns
    -------
    dict[str, str]
        Parameters by component, with their sign. A component that has the name of its parameter, or different
        parameters in several scenes, is left out.
    """
    words: dict[str, set[str]] = {}
    for scene in study.subtree if isinstance(study, xr.DataTree) else [study]:
        for name, (component, sign) in json.loads(scene.attrs.get("forces", "{}")).items():
            words.setdefault(component, set()).add(f"{'-' if sign < 0 else ''}{name}")
    return {component: min(shown) for component, shown in words.items() if len(shown) == 1 and shown != {component}}


def is_load(study: xr.Dataset, name: str) -> bool:
    """Whether a parameter of a study is a component of the force or displacement, or the pressure.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene.
    name : str
        Name of the parameter.

    Returns
    -------
    bool
        Whether the parameter is a load; False for an unknown parameter.
    """
    return _is_load(roles_of_study(study).get(name, ""))


def _is_load(role: str) -> bool:
    return any(role in names for names in LOADS)


def with_forces_named(study: xr.Dataset) -> xr.Dataset:
    """Rename the parameters of a study that set the force and the time of the load to ``fx``, ``fy``, ``fz``, ``time``.

    A parameter that is used with a negative sign, as ``-$push``, changes its sign.

    The roles of the parameters are read from the attributes ``forces`` and ``roles``, which come from the scene; the
    result has no attribute ``forces``. Other parameters with one of these names are renamed to ``parameter fz`` and the
    like, unless the scene has no parameter for a load: the role of its parameters is then their name.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene.

    Returns
    -------
    xr.Dataset
        The study itself if it is renamed already.
    """
    if "forces" not in study.attrs:
        return study

    # New names: of force components and of the time, and of parameters whose name these take.
    forces = {name: tuple(role) for name, role in json.loads(study.attrs["forces"]).items()}
    recorded = json.loads(study.attrs.get("roles", "{}"))
    times = [name for name, (role, sign) in recorded.items() if role == TIME and sign > 0]
    parameters = json.loads(study.attrs.get("parameters", "{}"))
    names = {*map(str, study.coords), *map(str, study.dims), *parameters}
    new_names = {name: component for name, (component, _) in forces.items()} | dict.fromkeys(times, TIME)
    loads = [name for name, (role, _) in {**recorded, **forces}.items() if name in names and _is_load(role)]
    shadowed = {name for name in (*FORCES, *([TIME] if "roles" in study.attrs else [])) if loads and name in names}
    shadowed -= new_names.keys()
    new_names = {name: role for name, role in new_names.items() if name in names} | {
        name: f"parameter {name}" for name in shadowed
    }
    signs = {name: sign for name, (_, sign) in forces.items() if name in new_names}

    # Values of components with the opposite sign, and derivatives by them, change their sign.
    study = study.assign_attrs({name: value for name, value in study.attrs.items() if name != "forces"})
    study.attrs.pop("forces", None)
    for name, sign in signs.items():
        if sign < 0 and name in study.coords:
            study = study.assign_coords({name: (study[name].dims, -study[name].values + 0.0, study[name].attrs)})
    if "parameter" in study.coords:
        parameter_names = study.parameter.values.tolist()
        factors = xr.DataArray(
            [float(signs.get(name, 1)) for name in parameter_names],
            dims="parameter",
            coords={"parameter": study.parameter},
        )
        if "derivative" in study:
            derivative = study.derivative
            signed_derivative = (derivative * factors).transpose(*derivative.dims).assign_attrs(derivative.attrs)
            study = study.assign(derivative=signed_derivative)
        study = study.assign_coords(parameter=np.array([new_names.get(name, name) for name in parameter_names]))

    # Parameters whose names are needed are renamed first, so that these names are free.
    for group in (shadowed, new_names.keys() - shadowed):
        study = study.rename({name: new_names[name] for name in group if name in study.coords or name in study.dims})

    # Tables in the attributes are keyed by the new names.
    values = {
        name: f"{-float(word) + 0.0:.12g}" if signs.get(name, 1) < 0 else word for name, word in parameters.items()
    }
    tables: dict[str, Mapping[str, Any]] = {"parameters": values}
    tables |= {name: json.loads(study.attrs[name]) for name in ("units", "roles") if name in study.attrs}
    for title, table in tables.items():
        study.attrs[title] = json.dumps({new_names.get(name, name): value for name, value in table.items()})
    study.attrs["curve"] = new_names.get(study.attrs.get("curve", ""), study.attrs.get("curve", ""))
    return study
