"""Tables in CSV files, and their interpolation against the polar angle inside kernels."""

from __future__ import annotations

import re

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.backend.plugin_objects import found
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.table import separated
from mitsuba_taxel.base.files.text import read_text

NODES = 4096
"""Points of a table inside kernels, the same for every file, so that another file needs no new kernel."""

SMALLEST_STEP = 1e-3
"""Degrees between two rows: closer angles are nearly equal in single precision."""

RIGHT_ANGLE, NARROW = 1.571, 0.2
"""In radians, rounded up. A table that ends between the two is taken to be in radians: hardly any part has so narrow a
beam in degrees, and many end there in radians, from 11 to 90 degrees."""


class Interpolant:
    """A function that is linear between its nodes and zero outside them.

    Parameters
    ----------
    nodes : (NODES,) ndarray
        Strictly increasing.
    values : (NODES,) ndarray
        At the nodes.
    """

    def __init__(self, nodes: np.ndarray, values: np.ndarray) -> None:
        self.nodes = mi.Float(in_packets(nodes))
        self.values = mi.Float(in_packets(values))

    def __call__(self, x: mi.Float) -> mi.Float:
        cell = find_cell(self.nodes, x)
        left, right = dr.gather(mi.Float, self.nodes, cell), dr.gather(mi.Float, self.nodes, cell + 1)
        low, high = dr.gather(mi.Float, self.values, cell), dr.gather(mi.Float, self.values, cell + 1)
        inside = (x >= left) & (x <= right)
        return dr.select(inside, dr.lerp(low, high, (x - left) / (right - left)), 0)


def find_cell(nodes: mi.Float, x: mi.Float) -> mi.UInt32:
    """The last of the ``NODES - 1`` intervals between increasing ``nodes`` that starts at or before ``x``."""
    return dr.binary_search(1, NODES - 1, lambda i: dr.gather(mi.Float, nodes, i) <= x) - 1


def refine(angles: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same function, linear between the rows of a table, at ``NODES`` angles.

    All rows are kept; the remaining nodes subdivide the intervals between them as evenly as possible, so that
    neighbours are at most 90 / (NODES - rows) degrees apart.

    Parameters
    ----------
    angles, values : (n,) ndarray
        With n of at most ``NODES``; angles start at 0.

    Returns
    -------
    angles, values : ndarray
        (NODES,).
    """
    rows = len(angles)
    place = np.arange(rows) + np.floor((NODES - rows) * (angles / angles[-1]))
    nodes = np.arange(NODES)
    return np.interp(nodes, place, angles), np.interp(nodes, place, values)


def read_angular_table(file: str) -> tuple[np.ndarray, np.ndarray]:
    """The table in the CSV file of the parameter ``file``, resolved like a scene's other files.

    Two columns: polar angle in degrees, value. Empty lines and text after a ``#`` are ignored.

    Parameters
    ----------
    file : str
        Its name in the scene.

    Returns
    -------
    angles : (n,) ndarray
        In degrees, from 0 to at most 90, strictly increasing.
    values : (n,) ndarray
        Finite, at least 0, not all 0.

    Raises
    ------
    InputError
        if the file cannot be read, or holds anything else.
    """
    angles, values = read_columns("file", file, fewest=2).T
    _check_angles(file, angles)
    _check_values(file, values)
    return angles, values


def read_columns(parameter: str, file: str, fewest: int) -> np.ndarray:
    """The numbers in the CSV file of a parameter, two columns, (n, 2) with n from ``fewest`` to ``NODES``."""
    given = f"{parameter} = {file!r}"
    lines = [words for line in read_text(given, found(file)).splitlines() if (words := line.split("#")[0].strip())]
    mark, fields = separated(given, lines)
    if mark != ",":  # decimal commas
        fields = [[word.replace(",", ".") for word in row] for row in fields]
    if fields and not _is_pair(fields[0]) and all(re.match(r"[^\W\d]", word) for word in fields[0]):
        fields = fields[1:]  # a heading
    for row, pair in enumerate(fields, start=1):
        if not _is_pair(pair):  # it is not quoted: a scene may name any file
            raise InputError(f"{given}: row {row} is not allowed: two columns of numbers are needed.")
    table = np.array(fields, dtype=float).reshape(-1, 2)
    rows, columns = table.shape
    if columns != 2 or not fewest <= rows <= NODES:
        raise InputError(
            f"{given} has {rows} rows and {columns} columns: from {fewest} to {NODES} rows and 2 columns are needed."
        )
    return table


def _is_pair(words: list[str]) -> bool:
    try:
        return len([float(word) for word in words]) == 2
    except ValueError:
        return False


def _check_angles(file: str, angles: np.ndarray) -> None:
    with np.errstate(invalid="ignore"):
        steps = np.diff(angles, prepend=-SMALLEST_STEP)
    allowed = np.isfinite(angles) & (steps >= SMALLEST_STEP * (1 - 1e-6)) & (angles <= 90)
    allowed[0] = angles[0] == 0
    if not allowed.all():
        row = int(np.argmin(allowed))
        raise InputError(
            f"file = {file!r}: the angle {angles[row]:g} in row {row + 1} is not allowed: angles must start at 0 and "
            f"increase to at most 90 degrees, by at least {SMALLEST_STEP:g} from row to row."
        )
    if NARROW < angles[-1] <= RIGHT_ANGLE:
        raise InputError(
            f"file = {file!r}: the angles end at {angles[-1]:g}, and look like radians: degrees are needed (a beam as "
            "narrow as that is described by cone_angle or exponent)."
        )


def _check_values(file: str, values: np.ndarray) -> None:
    allowed = np.isfinite(values) & (values >= 0)
    if not allowed.all():
        row = int(np.argmin(allowed))
        raise InputError(
            f"file = {file!r}: the value {values[row]:g} in row {row + 1} is not allowed: finite numbers of at least 0 "
            "are needed."
        )
    if not values.any():
        raise InputError(f"file = {file!r}: all values are 0, but at least one above 0 is needed.")
