"""The jobs of a study, one for each scene, by curve."""

from __future__ import annotations

from collections.abc import Sequence

from mitsuba_taxel.sensing.reading.prepared_scenes import Settings
from mitsuba_taxel.studies.plan.batch import Batch
from mitsuba_taxel.studies.plan.job import Job
from mitsuba_taxel.studies.plan.vary import checked_places, combinations, curve_dimension, sides_along
from mitsuba_taxel.studies.store.curve_slopes import fitted_forces


def curve_jobs(batch: Batch, settings: Settings, stored: bool) -> list[list[Job]]:
    """Create the jobs of a batch, grouped by curve.

    A curve has the scenes along one dimension (`curve_dimension`), which may share a load path.

    Parameters
    ----------
    batch : Batch
        Scene and varied parameters.
    settings : Settings
        Points and mesh size of all scenes.
    stored : bool
        Whether results are stored in a folder, with the requested meshes and maps.

    Returns
    -------
    list[list[Job]]
        The jobs of each curve, in the order of its dimension.
    """
    # What the jobs have in common. If no derivatives are requested, those by the varied forces are computed where they
    # cost little: without random numbers.
    curve = [axis.dim for axis in batch.axes].index(curve_dimension(batch.axes))
    keeps = {"all": stored, "none": False}
    checked = checked_places(batch.axes[curve])
    offered = not batch.derivatives and not settings.points and not batch.bare
    fitted = fitted_forces(batch.axes, batch.derivatives, batch.forces) if batch.from_paths else ()
    base_load = _base_load(batch, fitted, settings)

    # One job for each combination; the indices along the other dimensions identify its curve.
    curves: dict[tuple[int, ...], list[Job]] = {}
    sides = [sides_along(axis) for axis in batch.axes]
    parameters: dict[str, str] = {}
    for number, (index, values) in enumerate(combinations(batch.axes)):
        parameters = {**(parameters or batch.parameters(values)), **values}  # the scene is read once
        job = Job(
            number=number,
            file=batch.file,
            parameters=parameters,
            points=settings.points,
            seed=batch.seed,
            mesh_size=settings.mesh_size,
            mechanics_error=index[curve] in checked and not batch.bare,
            derivatives=batch.varied_forces if offered else batch.derivatives,
            where_smooth=offered,
            from_paths=batch.from_paths,
            base=None if base_load is None else {**parameters, **base_load},
            fitted=fitted,
            bare=batch.bare,
            sides={name: side for along, i in zip(sides, index, strict=True) for name, side in along[i].items()},
            meshes=not batch.bare and keeps.get(batch.meshes, stored and index[curve] == batch.axes[curve].size - 1),
            maps=stored and batch.maps,
        )
        curves.setdefault((*index[:curve], *index[curve + 1 :]), []).append(job)
    return list(curves.values())


def _base_load(batch: Batch, fitted: Sequence[str], settings: Settings) -> dict[str, str] | None:
    """Load of the base scene for random paths: the largest load of the curves. Scenes at other loads are read relative
    to the base scene.

    None if no curve is fitted to the readings.
    """
    along = curve_dimension(batch.axes)
    if along not in fitted or not settings.points or batch.maps:
        return None
    words = next(axis for axis in batch.axes if axis.dim == along).values[along]
    return {along: max(words, key=lambda word: abs(float(word)))}
