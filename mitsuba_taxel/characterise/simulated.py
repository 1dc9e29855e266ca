"""Experiments of a study: lines of load, the same changed by the errors of the shape, and tangential maps."""

from __future__ import annotations

from typing import NamedTuple

import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.characterise.experiment import Experiment
from mitsuba_taxel.characterise.load_lines import experiments
from mitsuba_taxel.characterise.roles import with_forces_named
from mitsuba_taxel.characterise.shape_error import Changed, off_by_shape, scenes_off_by_shape
from mitsuba_taxel.characterise.tangential import TangentialMap, tangential_maps
from mitsuba_taxel.electronics import Circuit, in_volts

ERROR = (
    "Error: 1 sigma of the light, from the random numbers that all scenes share, and what the errors of mechanics and "
    "geometry do; on maps and of symmetric pairs that of the light alone."
)


SLOPES = (
    "Slopes: from derivatives, without random numbers; their error is that of the derivatives, without that of the "
    "cubic curves between the forces."
)


class Simulated(NamedTuple):
    """``experiments``; ``off``, the same by mode of the errors of the shape, for ``characteristics``; ``maps``; and
    ``notes``."""

    experiments: list[Experiment]
    off: Changed
    maps: list[TangentialMap]
    notes: list[str]


def simulated_experiments(study: xr.Dataset | xr.DataTree, circuit: Circuit | None = None) -> Simulated:
    """The experiments of a study, as returned by ``open_study``; none if no force is varied.

    With a circuit, they are given in watts and in volts, distinguished by ``reading``.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        As returned by ``open_study``.
    circuit : Circuit, optional
        Behind which the readings are in V as well.

    Returns
    -------
    Simulated
        Experiments, the same changed by errors of the shape, maps and notes.
    """
    study = with_forces_named(study) if isinstance(study, xr.Dataset) else study.map_over_datasets(_named)
    scenes = [study] if isinstance(study, xr.Dataset) else [leaf.to_dataset() for leaf in study.leaves]
    notes = [ERROR, *dict.fromkeys(note for scene in scenes for note in scene.attrs.get("notes", "").splitlines())]
    missing = sum(int(scene.replicate_power.isnull().any(("replicate", "taxel")).sum()) for scene in scenes)
    if missing:
        notes.append(f"Jobs without a reading, left out: {missing}.")
    try:
        maps = tangential_maps(study)
    except InputError as error:
        maps = []
        notes.append(f"No map of tangential loads: {error}")
    off = scenes_off_by_shape(study) if isinstance(study, xr.DataTree) else off_by_shape(study)
    found = _shown(study, circuit)
    moved = {mode: [_shown(one, circuit) for one in both] for mode, both in off.items()}
    if any(run.tangents is not None for one in found for run in one.runs):
        notes.insert(1, SLOPES)
    return Simulated(found, moved, maps, notes)


def _named(leaf: xr.Dataset) -> xr.Dataset:
    return with_forces_named(leaf) if "power" in leaf else leaf


def _shown(study: xr.Dataset | xr.DataTree, circuit: Circuit | None) -> list[Experiment]:
    """The experiments of a study, with a circuit in watts and in volts."""
    watts = experiments(study)
    if circuit is None:
        return watts

    def shown(leaf: xr.Dataset) -> xr.Dataset:
        return in_volts(leaf, circuit) if "replicate_power" in leaf else leaf

    volts = shown(study) if isinstance(study, xr.Dataset) else study.map_over_datasets(shown)
    return [one.labelled(reading=one.unit) for one in (*watts, *experiments(volts))]
