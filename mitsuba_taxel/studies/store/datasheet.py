"""The datasheet of a training set: its origin, columns and limits of use."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import pandas as pd
import xarray as xr

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.base.left_out import LEFT_OUT
from mitsuba_taxel.electronics import saturated_words
from mitsuba_taxel.electronics.volts import circuit_of_study

MOST_NAMED = 20
"""Largest number of omitted jobs that are listed by their values."""

FORCE_COLUMNS = ("fx_N", "fy_N", "fz_N")


class TrainingRecord(NamedTuple):
    """Settings with which a training set was made.

    Attributes
    ----------
    noise : str
        Standard deviation of the noise added to the power, in words; empty without noise.
    in_volts : bool
        Whether there are voltages, with the noise of a circuit.
    copies : int
        Noisy copies of each job.
    seed : int
        Seed of split and noise.
    load : list[str]
        Headings of the columns by which rows are split.
    """

    noise: str
    in_volts: bool
    copies: int
    seed: int
    load: list[str]


def datasheet(
    studies: Mapping[str, xr.Dataset],
    tables: Mapping[str, pd.DataFrame],
    making: TrainingRecord,
    left_out: pd.DataFrame,
) -> str:
    """The datasheet of a training set, a page in Markdown.

    Parameters
    ----------
    studies : Mapping[str, xr.Dataset]
        Studies of the readings, by the scene's name.
    tables : Mapping[str, DataFrame]
        Training set by part.
    making : TrainingRecord
        Settings with which it was made.
    left_out : DataFrame
        Parameters of the jobs without readings, one row each.
    """
    sections = {
        "Where the readings come from": _source(studies),
        "Columns": _columns(pd.concat(tables.values())),
        "Noise": _noise(making),
        "Parts": _parts(tables, making),
        "Left out": _left_out(left_out),
        "Before you train": _caveats(studies),
    }
    body = "\n\n".join(f"## {heading}\n{text}" for heading, text in sections.items())
    return f"# Force and readings of {', '.join(_distinct(s.attrs['scene'] for s in studies.values()))}\n\n{body}\n"


def rows_line(counts: Mapping[str, int]) -> str:
    """A line that states the number of rows of the training, validation and test set.

    Parameters
    ----------
    counts : Mapping[str, int]
        Counts by part.

    Returns
    -------
    str
        One line.
    """
    return f"Rows: {', '.join(f'{name} {count}' for name, count in counts.items())}"


def _source(studies: Mapping[str, xr.Dataset]) -> str:
    """Section of the datasheet: scene, fixed parameters, seed and versions of each study, and the circuit."""
    lines = [
        "Simulated with mitsuba_taxel: a silicone pad deformed by finite elements, and the light in its cells.",
        "",
    ]
    for name, study in studies.items():
        about = study.attrs
        fixed = ", ".join(f"{word} = {value}" for word, value in json.loads(about["parameters"]).items())
        lines.append(f"- {f'{name}: ' if name else ''}scene {about['scene']} with {fixed or 'no fixed parameters'}; ")
        paths = f"{about['points']} points for each taxel and randomisation"
        lines[-1] += f"seed {about['seed']}, {paths if about['points'] else 'light without random numbers'}"
    versions = _distinct(
        ", ".join(f"{package} {version}" for package, version in json.loads(study.attrs["versions"]).items())
        for study in studies.values()
    )
    circuits = _distinct(
        ", ".join(f"{word} = {value}" for word, value in json.loads(study.attrs["circuit"]).items())
        for study in studies.values()
        if "circuit" in study.attrs
    )
    return "\n".join(
        [*lines, *(f"- circuit: {words}" for words in circuits), *(f"- versions: {words}" for words in versions)]
    )


def _columns(rows: pd.DataFrame) -> str:
    """Section of the datasheet: a table of the columns with their meanings and ranges."""
    lines = []
    for name, column in rows.items():
        unit, meaning = _meaning(str(name))
        if pd.api.types.is_numeric_dtype(column):
            extent = f"{column.min():.6g}", f"{column.max():.6g}"
        else:
            extent = f"one of {', '.join(_distinct(column.astype(str)))}", ""
        lines.append((str(name), unit, meaning, *extent))
    headings = ("column", "unit", "meaning", "smallest", "largest")
    table = markdown_table(headings, lines, headings[:3])
    return f"Each row is one job of the study, or one noisy copy of it.\n\n{table}"


def _meaning(column: str) -> tuple[str, str]:
    """Unit and meaning of a column."""
    stem, _, unit = column.rpartition("_")
    if column in FORCE_COLUMNS:
        return "N", f"{column[1]} component of the force on the pad; compression is fz < 0"
    if stem.startswith(("reaction_f", "reaction_m")):
        kind = "force" if stem[9] == "f" else "moment"
        return unit, f"{stem[-1]} component of the {kind} of the plate or the indenter on the pad"
    if stem.startswith("centre_of_pressure_"):
        of_what = "the centre of pressure of the plate or the indenter"
        return unit, f"{stem[-1]} of {of_what}; NaN (blank in CSV) where nothing touches; 0 in the layout of LeRobot"
    if stem.startswith("power_") and unit == "W":
        return "W", f"reading of taxel {stem.removeprefix('power_')}: optical power on its phototransistor"
    if stem.startswith("standard_error_") and unit == "W":
        return (
            "W",
            f"1 sigma of taxel {stem.removeprefix('standard_error_')} from the simulated light, without the noise",
        )
    if stem.startswith("voltage_") and unit == "V":
        taxel = stem.removeprefix("voltage_")
        return (
            "V",
            f"voltage of taxel {taxel} before the converter, for that power, with the noise of the circuit",
        )
    if stem == "counts":
        return "", f"counts of the converter for voltage_{unit}_V"
    if column == "scene":
        return "", "which of the scenes above"
    return (unit if unit in ("mm", "MPa", "W", "nm") else ""), "parameter of the scene"


def _noise(making: TrainingRecord) -> str:
    """Section of the datasheet: the noise in power and voltages, and the noisy copies."""
    copies = "One noisy copy" if making.copies == 1 else f"{making.copies} noisy copies"
    of_light = (
        "Gaussian, added to each reading, independent of other readings and of the Monte Carlo error; its standard "
        f"deviation is {making.noise}. Nothing is clipped: with large noise, a reading can be negative."
        if making.noise
        else "None was added to the power, which carries the Monte Carlo error of the light: it has its own columns."
    )
    of_circuit = "Voltages have the noise of the circuit as well, independent from sample to sample."
    lines = [of_light, *([of_circuit] if making.in_volts else [])]
    return " ".join([*lines, *([f"{copies} of each job."] if making.noise or making.in_volts else [])])


def _parts(tables: Mapping[str, pd.DataFrame], making: TrainingRecord) -> str:
    """Section of the datasheet: the split of the rows into parts, and their numbers."""
    counts = []
    for name, table in tables.items():
        counts.append((name, str(len(table[making.load].drop_duplicates())), str(len(table))))
    loads = "forces" if making.load[0] in FORCE_COLUMNS else f"values of {' and '.join(making.load)}"
    load = loads.replace("forces", "force").replace("values", "value")
    return (
        f"{markdown_table(('part', loads, 'rows'), counts)}\n\n"
        f"All rows of one {load}, whatever their noise and other parameters, are in the same part. They are ranked "
        f"by a hash with the seed ({making.seed}), and the ranking is cut at the requested shares. The part of a "
        f"{load} depends neither on noise, copies and other parameters nor on failed jobs. When {loads} are added to "
        "the study, only those next to a cut can change part."
    )


def _left_out(jobs: pd.DataFrame) -> str:
    """Section of the datasheet: a list of the jobs without readings."""
    if jobs.empty:
        return "None: every job of the study gave readings."
    varied = jobs[[name for name in jobs if name in ("fx", "fy", "fz", "scene") or jobs[name].nunique() > 1]]
    named = ["; ".join(f"{name} = {value}" for name, value in job.items()) for job in varied.to_dict("records")]
    lines = [f"{len(jobs)} jobs of the study that failed or were not done:", "", *(f"- {job}" for job in named)]
    more = len(named) - MOST_NAMED
    return "\n".join(lines if more <= 0 else [*lines[:-more], f"- and {more} more"])


def _caveats(studies: Mapping[str, xr.Dataset]) -> str:
    """Section of the datasheet: limits of the data."""
    notes = _distinct(note for study in studies.values() for note in study.attrs.get("notes", "").splitlines())
    caveats = [
        "Readings of one study share their random numbers: their Monte Carlo errors are correlated between rows and "
        "between parts. A model can learn the common error, which this test set does not show; a test set "
        "from a study with another seed shows it.",
        "The standard error is that of the light alone. The error of the deformed pad is not included, and is the same "
        "in all copies of a job; the study's notes on it are given below.",
        "All parts cover the same ranges of force: the test measures how well a model interpolates within them, not "
        "how it extrapolates.",
        f"All data are simulated. {LEFT_OUT['training']}",
    ]
    circuits = [(circuit_of_study(study), study) for study in studies.values()]
    saturated = (saturated_words(circuit, study.power.values) for circuit, study in circuits if circuit is not None)
    caveats += [f"Before the noise, {words}." for words in saturated if words]
    return "\n".join([*(f"- {caveat}" for caveat in caveats), *(f"- Note of the study: {note}" for note in notes)])


def _distinct(words: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(words))
