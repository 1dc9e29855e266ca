"""Training sets of forces and noisy readings, split into three parts without common forces."""

from __future__ import annotations

import json
import math
from collections.abc import Hashable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from mitsuba_taxel.base.arguments import (
    check_flags,
    check_seed,
    is_number,
    is_row,
    is_whole,
    path_of,
    plain_number,
    require,
)
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import replacing, write_text
from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.characterise.roles import roles_of_study, with_forces_named
from mitsuba_taxel.electronics import Circuit
from mitsuba_taxel.electronics.samples import sampled
from mitsuba_taxel.electronics.volts import circuit_of_study
from mitsuba_taxel.studies.plan.files import make_empty_folder
from mitsuba_taxel.studies.store.datasheet import TrainingRecord, datasheet
from mitsuba_taxel.studies.store.tables import check_parquet
from mitsuba_taxel.studies.store.training_files import (
    WRENCH,
    Column,
    TrainingPart,
    check_hdf5,
    write_hdf5,
    write_lerobot,
)

PARTS = ("train", "validation", "test")

PLACES = ("indenter_x", "indenter_y", "patch_x", "patch_y")
"""Roles of the parameters that give the place of contact."""
NAMED = (*FORCES, *PLACES)
OF_CONTACT = (*WRENCH, "centre_of_pressure_x", "centre_of_pressure_y")
"""Results of a bonded plate or an indenter that are columns beside the parameters."""
LEAST_FORCES = 10
"""Smallest number of distinct forces that can be split into three useful parts."""


class _TrainingRows(NamedTuple):
    """Readings of jobs, one row for each job: parameters, power and its standard error (rows, taxels) in W, units by
    name, the number of the curve (rows,) in the study, and the parameters that vary along a curve."""

    parameters: pd.DataFrame
    power: np.ndarray
    standard_error: np.ndarray
    units: dict[str, str]
    path: np.ndarray
    curve: list[str]

    @property
    def by_curve(self) -> bool:
        """Whether rows are split by the parameters that vary along a curve, because no force is varied: the force of an
        indenter or a plate is then a result.
        """
        forces = _force_columns(self.parameters)
        return WRENCH[0] in self.parameters and all(self.parameters[name].nunique() <= 1 for name in forces)

    @property
    def load(self) -> list[str]:
        """Parameters by which rows are split: components of the force, or the parameters that vary along a curve, such
        as the depth of an indenter.
        """
        return self.curve if self.by_curve else _force_columns(self.parameters)


def training_set(
    study: xr.Dataset | xr.DataTree,
    output: str | Path | None = None,
    *,
    noise: float | str = 0.0,
    copies: int = 1,
    split: Sequence[float] = (0.7, 0.15, 0.15),
    seed: int = 0,
    parquet: bool = False,
    hdf5: bool = False,
    lerobot: bool = False,
) -> dict[str, pd.DataFrame]:
    """Create tables of forces and readings for training a calibration model: a training, validation and test set.

    All rows with the same force belong to the same set, whatever their noisy copy and their other parameters are. If
    forces are results of a study by the depth of an indenter, the same holds for rows with the same depth; if several
    parameters vary together along its curves, for rows with the same values of all of them. Forces are sorted by a hash
    of seed and force, and this order is cut at the given fractions. The set of a force thus depends neither on noise,
    copies and other parameters nor on failed jobs. If forces are added later, only forces next to a cut can change
    their set.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        Readings over force components ``fx``, ``fy``, ``fz`` in N, or over the depth of an indenter, and any other
        parameters; or a tree of such datasets.
    output : str or Path, optional
        Folder for ``train.csv``, ``validation.csv``, ``test.csv`` and a datasheet, ``README.md``; must be new or empty.
    noise : float or str
        Standard deviation of Gaussian noise on every reading, independent of the Monte Carlo error: a number in W, or a
        share of the reading, such as ``"0.5%"``. Voltages have the noise of the circuit as well.
    copies : int
        Number of noisy copies of each job.
    split : sequence of float
        Fractions of the training, validation and test set, each above 0; their sum is 1.
    seed : int
        Seed of split and noise, from 0 to 2**32 - 1.
    parquet : bool
        Whether to write each table as Parquet too.
    hdf5 : bool
        Whether to write all tables as ``dataset.h5`` too: a group for each part, with units.
    lerobot : bool
        Whether to write the folder ``lerobot`` too, in the layout of LeRobot 3.0. An episode has the forces of one
        curve that belong to the same set.

    Returns
    -------
    dict[str, pd.DataFrame]
        Tables ``train``, ``validation`` and ``test`` with a row for each job and copy. Columns: force in N (``fx_N``,
        ...; fixed components too); the scene's name, if there are several scenes; other parameters that differ between
        jobs; force, moment and centre of pressure of a bonded plate or an indenter (``reaction_fx_N``, ...); for each
        taxel the noisy power ``power_1_W``, ..., and ``standard_error_1_W``, ..., the standard error of the light
        without the noise. With a circuit also ``voltage_1_V``, ..., with the noise of light and circuit, and
        ``counts_1``, .... Jobs without a reading are omitted.

    Raises
    ------
    InputError
        if a value is refused, the study contains too few forces, or the folder cannot be written to.
    """
    folder = None if output is None else path_of("output", output)
    check_flags(parquet=parquet, hdf5=hdf5, lerobot=lerobot)
    sigma, relative = _read_noise(noise)
    if parquet or lerobot:
        check_parquet()
    if hdf5:
        check_hdf5()
    studies = _scenes(study)
    first_study = next(iter(studies.values()))
    circuit = circuit_of_study(first_study)
    _check(split, copies, seed, sigma > 0 or circuit is not None)
    copies, seed = plain_number(copies), plain_number(seed)

    # The readings of all scenes, and the part of the training set to which each row belongs.
    rows = _rows(studies)
    subset = _part_of(rows.parameters[rows.load], split, seed)
    done = np.isfinite(rows.power).all(axis=1)

    random = np.random.default_rng(seed)
    # Noisy copies of the readings, and the columns that follow from them.
    spread = sigma * np.abs(rows.power) if relative else sigma
    noisy = rows.power + spread * random.standard_normal((copies, *rows.power.shape))
    copied = [_table(rows, _columns(rows, power, circuit, random), first_study.taxel.values)[done] for power in noisy]

    # Rows of all copies by part.
    tables = {
        name: pd.concat([table[subset[done] == number] for table in copied], ignore_index=True)
        for number, name in enumerate(PARTS)
    }
    for name, table in tables.items():
        if table.empty:
            raise InputError(f"split = {tuple(split)} is not allowed: no job with readings is left for {name}.")

    # Files, with the datasheet.
    if folder is not None:
        left_out = rows.parameters[~done]
        words = f"{100 * sigma:g}% of each reading" if relative else f"{sigma:g} W"
        load = [_heading(name, rows.units) for name in rows.load]
        making = TrainingRecord(words if sigma > 0 else "", circuit is not None, copies, seed, load)
        sheet = datasheet(studies, tables, making, left_out)
        _write(folder, tables, sheet, parquet)
        # Files with all parts, with the numbers of curve and copy for each row.
        path, copy = np.tile(rows.path[done], copies), np.repeat(np.arange(copies), done.sum())
        belongs = np.tile(subset[done], copies)
        parts = {
            name: TrainingPart(tables[name], path[belongs == number], copy[belongs == number])
            for number, name in enumerate(PARTS)
        }
        columns = _described(tables[PARTS[0]], rows, first_study)
        if hdf5:
            write_hdf5(parts, columns, first_study.taxel.values, {"about": sheet}, folder / "dataset.h5")
        if lerobot:
            write_lerobot(parts, columns, folder / "lerobot")
    return tables


def _described(table: pd.DataFrame, rows: _TrainingRows, study: xr.Dataset) -> dict[str, Column]:
    """Name, unit and role of each column of a training set that does not belong to a taxel, by heading."""
    headings = {_heading(name, rows.units): name for name in rows.parameters}
    known = (*NAMED, *OF_CONTACT)
    roles = {**roles_of_study(study), **{name: name for name in (*FORCES, *OF_CONTACT)}}
    return {
        heading: Column(name, rows.units.get(name, ""), roles.get(name, "") if roles.get(name) in known else "")
        for heading, name in headings.items()
        if heading in table
    }


def _heading(name: str, units: Mapping[str, str]) -> str:
    """Heading of a parameter's column, with its unit."""
    return f"{name}_{units[name]}" if units.get(name, "1") != "1" else name


def _read_noise(noise: float | str) -> tuple[float, bool]:
    """Standard deviation of the noise, and whether it is relative to the reading rather than in W."""
    words = str(noise).strip()
    try:
        sigma = float(words.removesuffix("%"))
    except ValueError:
        sigma = math.nan
    if not 0 <= sigma < math.inf:
        raise InputError(f"noise = {noise!r} is not allowed: 0 or above, in W or in % of each reading, is needed.")
    return (sigma / 100, True) if words.endswith("%") else (sigma, False)


def _check(split: Sequence[float], copies: int, seed: int, noisy: bool) -> None:
    """Raise `InputError` for a split, a number of copies or a seed that is not allowed."""
    check_split(split)
    if not is_whole(copies) or copies < 1 or (copies > 1 and not noisy):
        raise InputError(f"copies = {copies!r} is not allowed: 1 or above, and above 1 only with noise, is needed.")
    check_seed(seed)


def check_split(split: Sequence[float]) -> None:
    """Check the fractions of the training, validation and test set: three numbers above 0 whose sum is 1.

    Parameters
    ----------
    split : Sequence[float]
        The fractions.

    Raises
    ------
    InputError
        if they are anything else.
    """
    good = is_row(split, is_number) and len(split) == len(PARTS) and min(split) > 0
    if not (good and math.isclose(sum(split), 1)):
        raise InputError(f"split = {split!r} is not allowed: three shares above 0, which add up to 1, are needed.")


def _scenes(study: xr.Dataset | xr.DataTree) -> dict[str, xr.Dataset]:
    """Studies by the name of their scene, which is blank for a study of one scene.

    Raises
    ------
    InputError
        if the argument is no study, or holds no power.
    """
    require("study", study, (xr.Dataset, xr.DataTree), "a result of sweep or open_study")
    if isinstance(study, xr.Dataset):
        scenes = {"": study}
    else:
        scenes = {node.path.strip("/"): node.to_dataset() for node in study.subtree}
    scenes = {name: with_forces_named(scene) for name, scene in scenes.items() if "power" in scene}
    if not scenes:
        raise InputError("the study has no readings: a study of readings is needed.")
    return scenes


def _rows(studies: Mapping[str, xr.Dataset]) -> _TrainingRows:
    """The jobs of all scenes, concatenated.

    Raises
    ------
    InputError
        if scenes differ in their taxels, components of force or the parameters by which rows are split, or if there are
        no such parameters.
    """
    per_scene = [_rows_of(study) for study in studies.values()]
    first, *rest = per_scene
    for name, rows in zip(list(studies)[1:], rest, strict=True):
        if rows.power.shape[1] != first.power.shape[1]:
            raise InputError(
                f"scene {name} has {rows.power.shape[1]} taxels, the first scene {first.power.shape[1]}: all scenes of "
                "a training set need equally many."
            )
        if _force_columns(rows.parameters) != _force_columns(first.parameters):
            raise InputError(
                f"scene {name} has other forces as parameters than the first scene: the same forces are needed."
            )
    if len(studies) > 1:
        for name, rows in zip(studies, per_scene, strict=True):
            rows.parameters.insert(0, "scene", name)
    parameters = pd.concat([rows.parameters for rows in per_scene], ignore_index=True)
    joined = _TrainingRows(
        parameters.apply(_as_numbers),
        np.concatenate([rows.power for rows in per_scene]),
        np.concatenate([rows.standard_error for rows in per_scene]),
        {name: unit for rows in per_scene for name, unit in rows.units.items()},
        np.concatenate([rows.path + start for rows, start in zip(per_scene, _starts(per_scene), strict=True)]),
        first.curve,
    )
    if joined.by_curve:
        _check_curves(studies, per_scene)
    return joined


def _check_curves(studies: Mapping[str, xr.Dataset], per_scene: Sequence[_TrainingRows]) -> None:
    """Raise `InputError` unless the same parameters, at least one, vary along the curves of all scenes."""
    first = per_scene[0].curve
    if not first:
        raise InputError(
            "no force and no parameter varies along the curves of the study: one that varies, such as the depth of the "
            "indenter, is needed to split a training set."
        )
    for name, rows in zip(studies, per_scene, strict=True):
        if set(rows.curve) != set(first):
            raise InputError(
                f"scene {name} varies {' and '.join(rows.curve) or 'no parameter'} along its curves, the first scene "
                f"{' and '.join(first)}: the same parameters are needed."
            )


def _starts(per_scene: Sequence[_TrainingRows]) -> list[int]:
    """Number of the first curve of each scene, if the curves of all scenes are numbered one after the other."""
    counts = [int(rows.path.max()) + 1 for rows in per_scene]
    return [sum(counts[:number]) for number in range(len(counts))]


def _rows_of(study: xr.Dataset) -> _TrainingRows:
    """Rows of one scene: its jobs, with the values of all parameters, varied and fixed."""
    power = study.power.transpose(..., "taxel")
    dims = power.dims[:-1]
    one_each = power.isel(taxel=0, drop=True)
    values: dict[Hashable, object] = dict(json.loads(study.attrs["parameters"]))
    for name, coordinate in one_each.coords.items():
        if name != "step":  # an index without a meaning
            values[name] = coordinate.broadcast_like(one_each).transpose(*dims).values.ravel()
    units = {**dict.fromkeys(FORCES, "N"), **json.loads(study.attrs.get("units", "{}"))}
    for name in OF_CONTACT:
        if name in study:
            values[name] = study[name].transpose(*dims).values.ravel()
            units[name] = study[name].attrs["units"]
    # A curve is a combination of indices along all dimensions except that of the curve.
    curve = study.attrs.get("curve", dims[0])
    lengths = [1 if dim == curve else study.sizes[dim] for dim in dims]
    path = np.broadcast_to(np.arange(math.prod(lengths)).reshape(lengths), power.shape[:-1]).ravel()
    along = {str(name): values for name, values in one_each.coords.items() if values.dims == (curve,)}
    varied = [name for name, values in along.items() if name != "step" and len(np.unique(values)) > 1]
    count = power.shape[-1]
    return _TrainingRows(
        pd.DataFrame(values, index=range(one_each.size)),
        power.values.reshape(-1, count),
        study.standard_error.transpose(*power.dims).values.reshape(-1, count),
        units,
        path,
        varied,
    )


def _as_numbers(column: pd.Series) -> pd.Series:
    """Convert a column of text to numbers; it is unchanged if a value is not a number."""
    try:
        return pd.to_numeric(column)
    except (ValueError, TypeError):
        return column


def _force_columns(parameters: pd.DataFrame) -> list[str]:
    return [name for name in FORCES if name in parameters]


def _part_of(loads: pd.DataFrame, split: Sequence[float], seed: int) -> np.ndarray:
    """Index into `PARTS` for each row of loads, (rows,); see `part_by_words`."""
    numeric = all(kind.kind in "fiu" for kind in loads.dtypes)
    words = [" ".join(f"{x + 0.0:.9g}" if numeric else str(x) for x in load) for load in loads.to_numpy()]
    by_force = not len(loads.columns) or loads.columns[0] in FORCES
    return part_by_words(words, split, seed, "forces" if by_force else f"values of {' and '.join(loads)}")


def part_by_words(words: Sequence[str], split: Sequence[float], seed: int, name: str) -> np.ndarray:
    """Assign rows to the parts of a training set; rows with the same text belong to the same part.

    The texts are sorted by a hash of seed and text, and this order is cut at the given fractions.

    Parameters
    ----------
    words : Sequence[str]
        Text that distinguishes the rows, such as their forces.
    split : Sequence[float]
        Fractions of the parts.
    seed : int
        Seed of the hash.
    name : str
        Plural noun for the things that the texts describe, such as ``forces``; for error messages.

    Returns
    -------
    (rows,) ndarray of int
        The indices.

    Raises
    ------
    InputError
        if there are too few distinct words.
    """
    ranked = sorted(set(words), key=lambda force: sha256(f"{seed} {force}".encode()).digest())
    if len(ranked) < LEAST_FORCES:
        raise InputError(f"distinct {name} in the study: {len(ranked)}, but at least {LEAST_FORCES} are needed.")
    cuts = np.round(np.cumsum(split)[:-1] * len(ranked))
    subsets = dict(zip(ranked, np.searchsorted(cuts, np.arange(len(ranked)), side="right"), strict=True))
    return np.array([subsets[force] for force in words])


def _columns(
    rows: _TrainingRows, power: np.ndarray, circuit: Circuit | None, random: np.random.Generator
) -> dict[str, np.ndarray]:
    """Columns of all taxels for noisy power (rows, taxels) in W, by the pattern of their names.

    Each is (rows, taxels): power, voltage and counts if there is a circuit, and the standard error of the light.
    """
    columns = {"power_{}_W": power}
    if circuit is not None:
        columns["voltage_{}_V"], columns["counts_{}"] = sampled(circuit, power, random)
    return {**columns, "standard_error_{}_W": rows.standard_error}


def _table(rows: _TrainingRows, columns: Mapping[str, np.ndarray], taxels: np.ndarray) -> pd.DataFrame:
    """The table of a training set: forces, parameters that differ between rows, and the columns of each taxel.

    Parameters
    ----------
    rows : _TrainingRows
        Parameters of the rows, and their units, which become part of the columns' names.
    columns : Mapping[str, np.ndarray]
        Columns (rows, taxels) by the pattern of their names, from :func:`_columns`.
    taxels : np.ndarray
        Numbers (taxels,) that replace the braces of a pattern.
    """
    forces = _force_columns(rows.parameters)
    other_parameters = [name for name in rows.parameters if name not in forces]
    varied = [name for name in other_parameters if name in OF_CONTACT or rows.parameters[name].nunique() > 1]
    named = {name: _heading(name, rows.units) for name in rows.units}
    parameters = rows.parameters[[*forces, *varied]].rename(columns=named)
    frames = [
        pd.DataFrame(values, columns=[pattern.format(taxel) for taxel in taxels]) for pattern, values in columns.items()
    ]
    return pd.concat([parameters, *frames], axis="columns")


def _write(folder: Path, tables: Mapping[str, pd.DataFrame], sheet: str, parquet: bool) -> None:
    make_empty_folder(folder)
    for name, table in tables.items():
        with replacing(folder / f"{name}.csv") as file:
            table.to_csv(file, index=False)
        if parquet:
            with replacing(folder / f"{name}.parquet") as file:
                table.to_parquet(file, index=False)
    write_text(folder / "README.md", sheet)
