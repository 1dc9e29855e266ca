"""Training sets in formats for machine learning: HDF5 with groups and units, and the layout of LeRobot."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import replacing, write_text
from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.studies.store.netcdf import has_hdf5, hdf5_image

FRAMES_PER_SECOND = 10
"""Nominal rate of the frames of an episode, which LeRobot requires; loads of a study are static."""
WRENCH = tuple(f"reaction_{kind}{axis}" for kind in "fm" for axis in "xyz")
"""Components of the force and the moment of a bonded plate or an indenter on the pad."""
CONTACT = "observation.contact"
"""Feature of LeRobot's layout that is 1 for frames with contact and 0 for frames without."""
CENTRE = ("centre_of_pressure_x", "centre_of_pressure_y")
"""Columns of the centre of pressure, which are NaN where nothing touches."""
LEROBOT_VERSION = "v3.0"
"""Version of the layout of LeRobot."""
_OF_TAXELS = {
    r"power_\d+_W": ("power", "W", "optical power, with the noise of the training set"),
    r"voltage_\d+_V": ("voltage", "V", "voltage, with the noise of the circuit"),
    r"counts_\d+": ("counts", "1", "counts of the converter"),
    r"standard_error_\d+_W": ("standard_error", "W", "1 sigma of the light, without the noise"),
}
"""Name, unit and meaning of the quantities of each taxel, by the pattern of their columns."""


class TrainingPart(NamedTuple):
    """Rows of one part of a training set.

    Attributes
    ----------
    table : pd.DataFrame
        Columns of the CSV file.
    path : (rows,) ndarray of int
        Number of the curve of the study to which a row belongs, from 0.
    copy : (rows,) ndarray of int
        Number of the noisy copy, from 0.
    """

    table: pd.DataFrame
    path: np.ndarray
    copy: np.ndarray


class Column(NamedTuple):
    """A column of a table: its name without unit, its unit, and the component of the force, of the wrench or of the
    contact position that it contains; blank if it contains something else.
    """

    name: str
    unit: str
    role: str = ""


def check_hdf5() -> None:
    """Raise `InputError` if HDF5 files cannot be written here."""
    if not has_hdf5():
        raise InputError("HDF5 needs h5netcdf: pip install h5netcdf h5py.")


def write_hdf5(
    parts: Mapping[str, TrainingPart],
    columns: Mapping[str, Column],
    taxels: np.ndarray,
    about: Mapping[str, str],
    file: Path,
) -> None:
    """Write a training set as one HDF5 file, which is also a NetCDF 4 file, with a group for each part and with units.

    A group has the variables of the columns (row,), ``power``, ``standard_error`` and, with a circuit, ``voltage`` and
    ``counts`` (row, taxel), and ``path`` and ``copy`` (row,).

    Parameters
    ----------
    parts : Mapping[str, TrainingPart]
        Parts by name.
    columns : Mapping[str, Column]
        Columns of the tables that do not belong to a taxel.
    taxels : (taxels,) ndarray
        Numbers of the taxels.
    about : Mapping[str, str]
        Attributes of the file.
    file : Path
        Output file, which is replaced if it exists.

    Raises
    ------
    InputError
        if h5netcdf is not installed.
    """
    check_hdf5()
    groups = {name: _group(part, columns, taxels) for name, part in parts.items()}
    image = hdf5_image({"/": xr.Dataset(attrs=dict(about)), **groups})
    with replacing(file) as temporary:
        temporary.write_bytes(image)


def _group(part: TrainingPart, columns: Mapping[str, Column], taxels: np.ndarray) -> xr.Dataset:
    variables: dict[str, Any] = {}
    for heading, column in columns.items():
        values = part.table[heading].to_numpy()
        values = values.astype(str).astype(object) if values.dtype.kind not in "fiub" else values
        variables[column.name] = ("row", values, {"units": column.unit} if column.unit else {})
    for name, (_, unit, meaning, values) in _taxel_columns(part.table).items():
        variables[name] = (("row", "taxel"), values, {"units": unit, "long_name": meaning})
    variables["path"] = ("row", part.path, {"long_name": "curve of the study, from 0"})
    variables["copy"] = ("row", part.copy, {"long_name": "noisy copy, from 0"})
    return xr.Dataset(variables, {"taxel": ("taxel", taxels, {"long_name": "taxel, row by row from (-x, +y)"})})


def _taxel_columns(table: pd.DataFrame) -> dict[str, tuple[list[str], str, str, np.ndarray]]:
    """Headings, unit, meaning and values (rows, taxels) of the quantities of taxels, by name."""
    found = {}
    for pattern, (name, unit, meaning) in _OF_TAXELS.items():
        headings = [heading for heading in table if re.fullmatch(pattern, heading)]
        if headings:
            found[name] = (headings, unit, meaning, table[headings].to_numpy(dtype=float))
    return found


def write_lerobot(parts: Mapping[str, TrainingPart], columns: Mapping[str, Column], folder: Path) -> None:
    """Write a training set in the layout of LeRobot 3.0: Parquet files of frames and episodes, with named features.

    An episode is the part of a curve of the study that belongs to one part of the set, for one noisy copy; its frames
    are in the order of the curve. Features are ``observation.power``, ``observation.voltage``, ``observation.wrench``
    (components of the force in N; of a bonded plate or an indenter also the moment in N mm),
    ``observation.contact_place`` (contact position, and centre of pressure, in mm), and
    ``observation.parameters``, the other varied numbers and, beside the force of a bonded plate or an indenter, the
    applied force; names of their elements end with the unit. Varied words, such as the kind of cell, are part of the
    task's text. Parts of the set are ``splits`` of the episodes. Times of frames are nominal, with `FRAMES_PER_SECOND`.
    Where nothing touches there is no centre of pressure. Frames have 0 instead, and ``observation.contact``, which is 1
    with contact and 0 without; statistics of the centre of pressure are those of the frames with contact. Other values
    that a scene of the study does not have are NaN.

    Parameters
    ----------
    parts : Mapping[str, TrainingPart]
        Parts by name.
    columns : Mapping[str, Column]
        Columns of the tables that do not belong to a taxel.
    folder : Path
        New folder.

    Raises
    ------
    InputError
        if pyarrow is not installed.
    """
    if find_spec("pyarrow") is None:
        raise InputError("the layout of LeRobot needs pyarrow: pip install pyarrow.")
    first = next(iter(parts.values())).table
    named = _features(first, columns)
    centre = [heading for heading in columns if columns[heading].role in CENTRE]

    # Frames: rows in the order of their episode, with the default features.
    tables: list[pd.DataFrame] = []
    lengths: list[np.ndarray] = []
    splits: dict[str, str] = {}
    start = 0
    for name, part in parts.items():
        order = np.lexsort((part.path, part.copy))  # a stable sort keeps the order of the curve within an episode
        episode = np.unique(np.stack([part.copy, part.path])[:, order], axis=1, return_inverse=True)[1].ravel()
        counts = np.bincount(episode)
        table = part.table.iloc[order].reset_index(drop=True)
        frames: dict[str, Any] = {feature: _elements(table, headings) for feature, headings in named.items()}
        if centre:
            frames[CONTACT] = table[centre].notna().all(axis=1).to_numpy(np.float32)
        frames["task"] = _tasks(table, columns)
        frames["frame_index"] = np.concatenate([np.arange(count) for count in counts])
        frames["episode_index"] = start + episode
        tables.append(pd.DataFrame(frames))
        lengths.append(counts)
        splits[name] = f"{start}:{start + len(counts)}"
        start += len(counts)
    table = pd.concat(tables, ignore_index=True)
    table["timestamp"] = (table.frame_index / FRAMES_PER_SECOND).astype(np.float32)
    length = np.concatenate(lengths)
    ends = np.cumsum(length)
    task_of_frame = table.pop("task")
    task_number, tasks = pd.factorize(task_of_frame)
    table["index"], table["task_index"] = np.arange(len(table)), task_number

    # Files, as LeRobot writes them.
    features: dict[str, dict[str, Any]] = {
        feature: {"dtype": "float32", "shape": [len(headings)], "names": headings}
        for feature, headings in named.items()
    }
    flags = [CONTACT] if centre else []
    features |= {flag: {"dtype": "float32", "shape": [1], "names": ["contact"]} for flag in flags}
    kinds = {"timestamp": "float32"} | dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64")
    features |= {name: {"dtype": dtype, "shape": [1], "names": None} for name, dtype in kinds.items()}
    statistics = {
        name: _statistics(np.stack(table[name].to_list()).reshape(len(table), -1)) for name in (*named, *flags, *kinds)
    }
    # Data loaders make numbers of all frames, and NaN would spread from them. Other unknown values stay NaN: a force or
    # a parameter that a scene does not have is not 0.
    for name, of_centre in ((name, np.isin(headings, centre)) for name, headings in named.items()):
        if of_centre.any():
            within = of_centre if len(of_centre) > 1 else of_centre[0]
            table[name] = [np.where(np.isnan(values) & within, np.float32(0), values) for values in table[name]]
    episodes = pd.DataFrame(
        {
            "episode_index": np.arange(len(length)),
            "tasks": [[task] for task in task_of_frame.iloc[ends - length]],
            "length": length,
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": ends - length,
            "dataset_to_index": ends,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
    )
    info = {
        "codebase_version": LEROBOT_VERSION,
        "robot_type": "mitsuba_taxel",
        "total_episodes": len(length),
        "total_frames": len(table),
        "total_tasks": len(tasks),
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": FRAMES_PER_SECOND,
        "splits": splits,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": features,
    }
    for part_folder in ("data/chunk-000", "meta/episodes/chunk-000"):
        (folder / part_folder).mkdir(parents=True)
    table.to_parquet(folder / "data/chunk-000/file-000.parquet", engine="pyarrow", index=False)
    episodes.to_parquet(folder / "meta/episodes/chunk-000/file-000.parquet", engine="pyarrow", index=False)
    numbered = pd.DataFrame({"task_index": np.arange(len(tasks))}, index=pd.Index(tasks, name="task"))
    numbered.to_parquet(folder / "meta/tasks.parquet", engine="pyarrow")
    write_text(folder / "meta/info.json", json.dumps(info, indent=4))
    write_text(folder / "meta/stats.json", json.dumps(statistics, indent=4))


def _elements(table: pd.DataFrame, headings: list[str]) -> list[Any]:
    """Values of a LeRobot feature, one entry for each frame: an array (elements,), or a number if there is only one
    element."""
    values = table[headings].to_numpy(np.float32)
    return list(values[:, 0] if len(headings) == 1 else values)


def _tasks(table: pd.DataFrame, columns: Mapping[str, Column]) -> list[str]:
    """Text of the task of each frame: ``touch``, followed by the frame's parameters that are words."""
    words = [heading for heading in columns if table[heading].dtype.kind not in "fiub"]
    return [
        ", ".join(["touch", *(f"{columns[heading].name} = {row[heading]}" for heading in words)])
        for row in table[words].to_dict("records")
    ]


def _features(table: pd.DataFrame, columns: Mapping[str, Column]) -> dict[str, list[str]]:
    """Assign columns to LeRobot features: the headings of the columns of each feature, by its name."""
    taxels = _taxel_columns(table)
    features = {f"observation.{name}": taxels[name][0] for name in ("power", "voltage") if name in taxels}
    numbers = [heading for heading in columns if table[heading].dtype.kind in "fiub"]
    reactions = [heading for heading in numbers if columns[heading].role in WRENCH]
    forces = [heading for heading in numbers if columns[heading].role in FORCES]
    place = [heading for heading in numbers if columns[heading].role not in ("", *FORCES, *WRENCH)]
    other = [heading for heading in numbers if not columns[heading].role or (reactions and heading in forces)]
    groups = {"wrench": reactions or forces, "contact_place": place, "parameters": other}
    return features | {f"observation.{name}": headings for name, headings in groups.items() if headings}


def _statistics(values: np.ndarray) -> dict[str, list[float]]:
    """Statistics by which LeRobot normalises a feature (frames, elements).

    Frames in which an element is NaN are omitted for this element. If it is NaN in all frames, its statistics are 0,
    because JSON has no NaN.
    """
    values = np.where(np.isnan(values).all(axis=0), 0.0, values.astype(float))
    quantiles = {f"q{percent:02d}": np.nanpercentile(values, percent, axis=0) for percent in (1, 10, 50, 90, 99)}
    moments = {"mean": np.nanmean(values, axis=0), "std": np.nanstd(values, axis=0)}
    figures = {"min": np.nanmin(values, axis=0), "max": np.nanmax(values, axis=0), **moments, **quantiles}
    return {**{name: figure.tolist() for name, figure in figures.items()}, "count": [len(values)]}
