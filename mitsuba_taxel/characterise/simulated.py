"""Experiments of a study: its lines of load, the same lines changed by the errors of the shape, and tangential maps."""

from __future__ import annotations

from typing import NamedTuple

import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.characterise.experiment import Experiment
from mitsuba_taxel.characterise.load_lines import experiments
from mitsuba_taxel.characterise.roles import with_forces_named
from mitsuba_taxel.characterise.shape_error import Changed, changed_by_shape, scenes_changed_by_shape
from mitsuba_taxel.characterise.tangential import TangentialMap, tangential_maps
from mitsuba_taxel.electronics import Circuit, in_volts

ERROR = (
    "Error: 1 sigma of the light, from the random numbers common to all scenes, combined with the errors of mechanics "
    "and geometry; on maps and for symmetric pairs, the error of the light alone."
)


SLOPES = (
    "Slopes: from derivatives, without random numbers; their error is that of the derivatives, without that of the "
    "cubic interpolation between the forces."
)


class Simulated(NamedTuple):
    """Experiments of a study, how errors of the pads' shape change them, maps of taxels under tangential loads, and
    notes.

    Attributes
    ----------
    experiments : list[Experiment]
        The lines of load.
    off : dict of lists
        Effect of the errors of the pads' shape. For each mode (see `changed_by_shape`): two lists of the same
        experiments, with readings changed up and down by one standard deviation.
    maps : list[TangentialMap]
        Changes of all taxels under tangential loads.
    notes : list[str]
        Notes on the contents of the errors, and remarks on the results.
    """

    experiments: list[Experiment]
    off: Changed
    maps: list[TangentialMap]
    notes: list[str]


def simulated_experiments(study: xr.Dataset | xr.DataTree, circuit: Circuit | None = None) -> Simulated:
    """Experiments of a study along its lines of load; the list is empty if no force is varied.

    With a circuit, each experiment is returned twice, in watts and in volts; its entry ``reading`` in ``where`` states
    the unit.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        Result of ``open_study``.
    circuit : Circuit, optional
        Circuit that converts the readings into V.

    Returns
    -------
    Simulated
        Experiments, the experiments changed by errors of the shape, maps and notes.
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
    changed_studies = scenes_changed_by_shape(study) if isinstance(study, xr.DataTree) else changed_by_shape(study)
    unchanged = _shown(study, circuit)
    changed = {mode: [_shown(experiment, circuit) for experiment in pair] for mode, pair in changed_studies.items()}
    if any(run.tangents is not None for experiment in unchanged for run in experiment.runs):
        notes.insert(1, SLOPES)
    return Simulated(unchanged, changed, maps, notes)


def _named(leaf: xr.Dataset) -> xr.Dataset:
    return with_forces_named(leaf) if "power" in leaf else leaf


def _shown(study: xr.Dataset | xr.DataTree, circuit: Circuit | None) -> list[Experiment]:
    """Experiments of a study as they are shown: in watts and, with a circuit, in volts as well."""
    watts = experiments(study)
    if circuit is None:
        return watts

    def converted(leaf: xr.Dataset) -> xr.Dataset:
        return in_volts(leaf, circuit) if "replicate_power" in leaf else leaf

    volts = converted(study) if isinstance(study, xr.Dataset) else study.map_over_datasets(converted)
    return [experiment.labelled(reading=experiment.unit) for experiment in (*watts, *experiments(volts))]
