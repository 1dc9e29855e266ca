"""Work-precision curves as a CSV file, and as rows of a table."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve, slope

COLUMNS = (
    "part", "method", "setting", "seconds", "error", "stated_error", "floor", "reference", "runs", "light_error",
    "mechanics_error", "stated_light", "stated_mechanics", "stated_geometry", "mechanics_seconds", "load_seconds",
    "optics_seconds", "remark",
)  # fmt: skip
HEADINGS = ("part", "method", "points", "error", "stated", "reference", "seconds", "slope", "remark")
POINT_HEADINGS = ("setting", "method", "varied", "error", "stated", "floor", "seconds")
PEERS = (
    "Radiance, raysect, a loop over Embree and CalculiX do special cases only, for which they were modelled by hand: "
    "taxel bench peers optics compares the first three with this project on a plate, Embree on pads too, and "
    "taxel bench peers mechanics compares CalculiX on a pad. For other scenes they cannot be run from here."
)


def write_csv(curves: Sequence[ErrorCurve], file: Path) -> None:
    """Write all points of curves to a CSV file in full precision, a line for each point; unknown values are empty.

    Parameters
    ----------
    curves : sequence of ErrorCurve
        The curves.
    file : Path
        CSV file, which is replaced.
    """
    with replacing(file) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        writer.writeheader()
        for curve in curves:
            for point in curve.points:
                row = {
                    "part": curve.part, "method": curve.method, "setting": point.setting, "seconds": point.seconds,
                    "error": point.error, "stated_error": point.stated, "floor": point.floor,
                    "reference": point.reference, "runs": point.runs, "remark": point.remark, **point.shares,
                }  # fmt: skip
                unknown = {name for name, value in row.items() if isinstance(value, float) and math.isnan(value)}
                writer.writerow({name: value for name, value in row.items() if name not in unknown})
            if not curve.points:
                writer.writerow({"part": curve.part, "method": curve.method, "remark": curve.remark})


def cells(curve: ErrorCurve) -> list[str]:
    """Summarise one method by the last point of its curve, as a row of the table in the order of :data:`HEADINGS`."""
    if not curve.points:
        return [curve.part, curve.method or "-", "0", "-", "-", "-", "-", "-", f"not possible: {curve.remark}"]
    last = curve.points[-1]
    steepness = slope(curve)
    return [
        curve.part,
        curve.method,
        str(len(curve.points)),
        f"{last.error:.2g}" if last.error > last.floor else f"< {last.floor:.2g}",
        "-" if math.isnan(last.stated) else f"{last.stated:.2g}",
        f"{last.reference} (+- {last.floor:.1g})",
        f"{last.seconds:.3g}",
        "-" if math.isnan(steepness.value) else f"{steepness.value:.2f} +- {steepness.standard_error:.2f}",
        "; ".join(dict.fromkeys(filter(None, [curve.remark, last.remark]))) or "-",
    ]


def point_cells(curve: ErrorCurve) -> list[list[str]]:
    """Format every point of a curve as a row of the table, in the order of :data:`POINT_HEADINGS`."""
    if not curve.points:
        return [[curve.part, curve.method, f"not possible: {curve.remark}", "-", "-", "-", "-"]]
    return [
        [
            curve.part,
            curve.method,
            point.setting,
            f"{point.error:.2g}" if point.error > point.floor else f"< {point.floor:.2g}",
            f"{point.stated:.2g}",
            f"{point.floor:.1g}",
            f"{point.seconds:.3g}",
        ]
        for point in curve.points
    ]
