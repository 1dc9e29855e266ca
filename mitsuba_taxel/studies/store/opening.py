"""Stored results as labelled arrays, read without loading a scene or executing code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray as xr

from mitsuba_taxel.base.arguments import is_number, path_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.electronics import with_volts
from mitsuba_taxel.electronics.circuit import circuit_of
from mitsuba_taxel.sensing.measurement import check_request
from mitsuba_taxel.sensing.reading.prepared_scenes import Settings
from mitsuba_taxel.sensing.scene.finding import is_file, why_unreadable
from mitsuba_taxel.studies.plan.batch import check_target_slope, loads_among, read_study
from mitsuba_taxel.studies.plan.job import IMAGES
from mitsuba_taxel.studies.plan.vary import combinations, make_axes
from mitsuba_taxel.studies.store.dataset import assemble
from mitsuba_taxel.studies.store.folder import STUDY, Store
from mitsuba_taxel.studies.store.provenance import own_code

OF_OTHER_CODE = "computed by another version of the program, which may have estimated errors differently"


def open_study(folder: str | Path) -> xr.Dataset | xr.DataTree:
    """Open the results of a study, complete or not, as a dataset.

    Parameters
    ----------
    folder : str or Path
        Folder of results: the ``output`` of a study.

    Returns
    -------
    xr.Dataset or xr.DataTree
        Dataset as ``sweep`` returns it, or tree as ``run_study`` returns it; missing readings are NaN.

    Raises
    ------
    InputError
        if the folder holds no study, or no result yet.
    """
    folder = path_of("folder", folder)
    study = read_results(folder)

    if (folder / IMAGES).is_dir():
        raise InputError(
            f"study {folder} holds images of a camera, not readings: their table is images.csv, `taxel report` "
            "shows them, and `taxel dataset` packs them."
        )

    # Several scenes: a tree of the studies that have results.
    names = [scene.get("name") for scene in study["scenes"]]
    if names != [None]:
        started = [name for name in names if (folder / name / STUDY).exists() and Store(folder / name).done()]
        if not started:
            raise InputError(f"study {folder} holds no result yet: run it first.")
        tree = xr.DataTree.from_dict({name: open_study(folder / name) for name in started})
        lines = [f"{name}: {line}" for name in started for line in tree[name].attrs["failures"].splitlines()]
        tree.attrs["failures"] = "\n".join(lines)
        return tree

    # One scene: its dimensions, as when the study was run, and all stored results.
    (scene,), origin, store = study["scenes"], study["provenance"], Store(folder)
    axes = make_axes(
        scene.get("vary", {}),
        scene.get("together"),
        forces=origin.get("forces", FORCES),
        loads=loads_among(origin.get("roles", {})),
    )
    jobs = dict(enumerate(combinations(axes)))
    results = {}
    for number in sorted(jobs.keys() & store.done()):
        index, values = jobs[number]
        kept = store.load(number, {**origin["parameters"], **values})
        if kept:
            results[index] = kept
    if not results:
        raise InputError(f"study {folder} holds no result yet: run it first.")
    failures = {jobs[number][0]: failure for number, failure in store.failures().items() if number in jobs}

    # The labelled array, from the definition of the study alone.
    settings, pilot_seconds = store.choice or (Settings(study.get("points", 0), None), {})
    about = {"scene": Path(scene["scene"]).name, "seed": study["seed"]}
    about |= {name: study.get(name) for name in ("target_error", "target_slope")}
    about |= {"derivatives": study.get("derivatives", ())}
    run = {**settings._asdict(), "pilot_seconds": pilot_seconds}
    circuit = circuit_of(study["circuit"]) if "circuit" in study else None
    opened = with_volts(assemble(axes, results, failures, {**origin, **about, **run}), circuit)
    if origin.get("code") != own_code():
        opened.attrs["notes"] = "\n".join(filter(None, [opened.attrs["notes"], OF_OTHER_CODE]))
    return opened


def stored_study(folder: Path) -> dict[str, Any]:
    """Read the study file in a folder of results of one scene; empty for any other folder.

    Parameters
    ----------
    folder : Path
        Any path.

    Returns
    -------
    dict[str, Any]
        Study and scene in one table.
    """
    try:
        study = read_results(folder)
    except InputError:
        return {}
    (scene, *more) = study.pop("scenes")
    return {} if more or scene.get("name") else {**study, **scene}


def read_results(folder: Path) -> dict[str, Any]:
    """Content of the study file in a folder of results, as :func:`read_study` returns it.

    Parameters
    ----------
    folder : Path
        Folder that was the ``output`` of a study.

    Returns
    -------
    dict[str, Any]
        Content of its study file.

    Raises
    ------
    InputError
        if there is no such file, or it was not written by a run.
    """
    reason = why_unreadable(folder / STUDY)
    if reason:
        raise InputError(f"study {folder} cannot be read: {reason}.")
    if not is_file(folder / STUDY):
        raise InputError(f"study {folder} is not allowed: the output folder of a study, with {STUDY}, is needed.")
    study = read_study(folder / STUDY)
    if not study["scenes"][0].get("name"):
        origin, scene = study.get("provenance"), study["scenes"][0].get("scene")
        tables: list[Any] = [None]
        if isinstance(origin, dict):
            tables = [origin.get("parameters"), origin.get("versions"), origin.get("units", {})]
            if not all(_are_roles(origin.get(name, {})) for name in ("forces", "roles")):
                tables.append(None)
        words = [word for table in tables for word in (table.values() if isinstance(table, dict) else [None])]
        if not (all(isinstance(word, str) for word in (*words, scene)) and "seed" in study):
            raise InputError(
                f"study {folder} holds no results: its {STUDY} lacks scene, seed or provenance; the output folder of a "
                "study is needed."
            )
        try:
            check_request(study.get("target_error"), study.get("points"), study["seed"], study.get("time_budget"))
            check_target_slope(study.get("target_slope"))
        except InputError as error:
            raise InputError(f"study {folder} is damaged, so compute it again into a new folder: {error}") from error
    return study


def _are_roles(roles: object) -> bool:
    """Whether the argument is a dictionary of pairs, role and factor."""
    return isinstance(roles, dict) and all(
        isinstance(role, list) and len(role) == 2 and isinstance(role[0], str) and is_number(role[1])
        for role in roles.values()
    )
