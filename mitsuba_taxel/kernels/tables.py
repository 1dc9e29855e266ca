"""Tables in CSV files, and their interpolation in kernels."""

from __future__ import annotations

import re

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.backend.plugin_objects import resolved_path
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.table import separated
from mitsuba_taxel.base.files.text import read_text

NODES = 4096
"""Nodes of a table in kernels; the number is the same for every file, so that another file needs no new kernel."""

SMALLEST_STEP = 1e-3
"""Least step in degrees between two rows: closer angles are nearly equal in single precision."""

RIGHT_ANGLE, NARROW = 1.571, 0.2
"""Largest and smallest last angle, in radians and rounded up, of a table that is considered to be in radians. Hardly
any part has such a narrow beam in degrees, but many tables in radians end there, at 11 to 90 degrees."""


class Interpolant:
    """A function that is linear between its nodes and zero outside them.

    Parameters
    ----------
    nodes : (NODES,) ndarray
        Nodes, strictly increasing.
    values : (NODES,) ndarray
        Values at the nodes.
    """

    def __init__(self, nodes: np.ndarray, values: np.ndarray) -> None:
        self.nodes = mi.Float(in_packets(nodes))
        self.values = mi.Float(in_packets(values))

    def __call__(self, x: mi.Float) -> mi.Float:
        cell = find_cell(self.nodes, x)
        lower, upper = dr.gather(mi.Float, self.nodes, cell), dr.gather(mi.Float, self.nodes, cell + 1)
        low, high = dr.gather(mi.Float, self.values, cell), dr.gather(mi.Float, self.values, cell + 1)
        inside = (x >= lower) & (x <= upper)
        return dr.select(inside, dr.lerp(low, high, (x - lower) / (upper - lower)), 0)


def find_cell(nodes: mi.Float, x: mi.Float) -> mi.UInt32:
    """Index of the last interval, of the ``NODES - 1`` intervals between increasing ``nodes``, that starts at or before
    ``x``.
    """
    return dr.binary_search(1, NODES - 1, lambda i: dr.gather(mi.Float, nodes, i) <= x) - 1


def refine(angles: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Refine a table, whose function is linear between rows, to ``NODES`` rows.

    All rows are kept. The additional nodes subdivide the intervals between rows as evenly as possible, so that
    neighbours differ by at most 90 / (NODES - rows) degrees.

    Parameters
    ----------
    angles, values : (n,) ndarray
        The table, with n of at most ``NODES``; angles start at 0.

    Returns
    -------
    angles, values : (NODES,) ndarray
        The refined table.
    """
    rows = len(angles)
    row_nodes = np.arange(rows) + np.floor((NODES - rows) * (angles / angles[-1]))
    nodes = np.arange(NODES)
    return np.interp(nodes, row_nodes, angles), np.interp(nodes, row_nodes, values)


def read_angular_table(file: str) -> tuple[np.ndarray, np.ndarray]:
    """Read the table in the CSV file of the parameter ``file``.

    The file has two columns: polar angle in degrees, value. Empty lines and text after a ``#`` are ignored.

    Parameters
    ----------
    file : str
        Name of the file, relative to the scene file.

    Returns
    -------
    angles : (n,) ndarray
        Angles in degrees, from 0 to at most 90, strictly increasing.
    values : (n,) ndarray
        Values, finite and at least 0; not all are 0.

    Raises
    ------
    InputError
        if the file cannot be read, or has other contents.
    """
    angles, values = read_columns("file", file, fewest=2).T
    _check_angles(file, angles)
    _check_values(file, values)
    return angles, values


def read_columns(parameter: str, file: str, fewest: int) -> np.ndarray:
    """Read the numbers in the CSV file of a parameter.

    Parameters
    ----------
    parameter : str
        Name of the parameter, for messages.
    file : str
        Name of the file, relative to the scene file.
    fewest : int
        Least number of rows.

    Returns
    -------
    (n, 2) ndarray
        Two columns of at most ``NODES`` rows.

    Raises
    ------
    InputError
        if the file cannot be read, or has other contents.
    """
    label = f"{parameter} = {file!r}"
    lines = [
        words for line in read_text(label, resolved_path(file)).splitlines() if (words := line.split("#")[0].strip())
    ]
    separator, fields = separated(label, lines)
    # Numbers may have decimal commas, and the first row may be a heading.
    if separator != ",":
        fields = [[word.replace(",", ".") for word in row] for row in fields]
    if fields and not _is_pair(fields[0]) and all(re.match(r"[^\W\d]", word) for word in fields[0]):
        fields = fields[1:]
    for row, pair in enumerate(fields, start=1):
        # The message does not quote the row, as a scene may name any file.
        if not _is_pair(pair):
            raise InputError(f"{label}: row {row} is not allowed: two columns of numbers are needed.")
    table = np.array(fields, dtype=float).reshape(-1, 2)
    rows, columns = table.shape
    if columns != 2 or not fewest <= rows <= NODES:
        raise InputError(
            f"{label} has {rows} rows and {columns} columns: from {fewest} to {NODES} rows and 2 columns are needed."
        )
    return table


def _is_pair(words: list[str]) -> bool:
    """Whether a row of text consists of two numbers."""
    try:
        return len([float(word) for word in words]) == 2
    except ValueError:
        return False


def _check_angles(file: str, angles: np.ndarray) -> None:
    """Raise `InputError` for angles that are not allowed."""
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
    """Raise `InputError` for values that are not allowed."""
    allowed = np.isfinite(values) & (values >= 0)
    if not allowed.all():
        row = int(np.argmin(allowed))
        raise InputError(
            f"file = {file!r}: the value {values[row]:g} in row {row + 1} is not allowed: finite numbers of at least 0 "
            "are needed."
        )
    if not values.any():
        raise InputError(f"file = {file!r}: all values are 0, but at least one above 0 is needed.")
