"""Studies whose forces have names of the user's own, as if they were called fx, fy and fz."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr


def with_forces_named(study: xr.Dataset) -> xr.Dataset:
    """A study in which the components of the force are called ``fx``, ``fy`` and ``fz``, and have their sign.

    What they were called is in the attribute ``forces``, from the scene, which the result does not have.
    """
    stated = json.loads(study.attrs.get("forces", "{}"))
    roles = {name: tuple(role) for name, role in stated.items() if name != role[0] or role[1] < 0}
    study = study.assign_attrs({name: value for name, value in study.attrs.items() if name != "forces"})
    study.attrs.pop("forces", None)
    parameters = json.loads(study.attrs.get("parameters", "{}"))
    roles = {name: role for name, role in roles.items() if name in study.coords or name in parameters}
    taken = {role[0] for role in roles.values()} - set(roles)
    if not roles or taken & ({*map(str, study.coords), *map(str, study.dims)} | set(parameters)):
        return study
    for name, (_, sign) in roles.items():
        if sign < 0 and name in study.coords:
            study = study.assign_coords({name: (study[name].dims, -study[name].values, study[name].attrs)})
    new = {name: component for name, (component, _) in roles.items()}
    if "parameter" in study.coords:
        names = study.parameter.values.tolist()
        signs = xr.DataArray(
            [float(roles[name][1]) if name in roles else 1.0 for name in names],
            dims="parameter",
            coords={"parameter": study.parameter},
        )
        for variable in ("derivative",):
            if variable in study:
                attributes = study[variable].attrs
                study[variable] = (study[variable] * signs).transpose(*study[variable].dims).assign_attrs(attributes)
        study = study.assign_coords(parameter=np.array([new.get(name, name) for name in names]))
    study = study.rename({name: component for name, component in new.items() if name in study.coords})
    study.attrs["parameters"] = json.dumps({new.get(name, name): value for name, value in parameters.items()})
    study.attrs["curve"] = new.get(study.attrs.get("curve", ""), study.attrs.get("curve", ""))
    return study
