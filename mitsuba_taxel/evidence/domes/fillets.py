"""Tables of `taxel bench fillets`: ends of load paths and slopes of one box with sharp and with rounded edges, on
elements of several sizes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.domes.domes import dome_scene
from mitsuba_taxel.evidence.rows.row import cells, headings
from mitsuba_taxel.mechanics import load_path
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE
from mitsuba_taxel.mechanics.materials.laws import NeoHookean
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
from mitsuba_taxel.sensing.derivatives.scene_rates import rates

EDGES: dict[str, dict[str, Any]] = {
    "sharp": {},
    "fillet 0.2 mm": {"fillet": 0.2},
    "all fillets 0.2 mm": {"fillet": 0.2, "mouth_fillet": 0.2, "outer_fillet": 0.2},
}
"""Edges of the box, by name."""
SIZES = (2.0, 1.25, 0.8)
"""Sizes of the elements in mm."""
FURTHEST = (8.0, 0.0, -8 / 9)
"""Force in N beyond the ends of all load paths. The normal force is that of 8 N on nine cells."""
SLOPE_EDGES = ("sharp", "fillet 0.2 mm")
SLOPE_SIZES = (1.25, 0.8, 0.55)
SLOPE_AT = (1.2, 0.0, -0.9)
"""Edges, sizes of the elements in mm, and force in N of the slopes."""


@dataclass(frozen=True)
class EndRow:
    """End of the load path of one box under a force along x.

    Attributes
    ----------
    edges : str
        Edges of the box; a name in `EDGES`.
    size : float
        Size of the elements in mm.
    elements : int
        Number of elements.
    end : float
        Force along x at the end of the path, N.
    reason : str
        Reason for the end.
    said : str
        What the message says about a second mesh.
    seconds : float
        CPU seconds of the path, with the second mesh.
    """

    COLUMNS: ClassVar = {
        "edges": ("edges", ""),
        "size": ("elements [mm]", "g"),
        "elements": ("number", "d"),
        "end": ("end [N]", ".3f"),
        "reason": ("the pad", ""),
        "said": ("second mesh", ""),
        "seconds": ("CPU s", ".0f"),
    }
    edges: str
    size: float
    elements: int
    end: float
    reason: str
    said: str
    seconds: float


@dataclass(frozen=True)
class EdgeSlopeRow:
    """Derivative of the reading of one box with respect to the force along x.

    Attributes
    ----------
    edges : str
        Edges of the box; a name in `EDGES`.
    size : float
        Size of the elements in mm.
    elements : int
        Number of elements.
    slope, error : float
        Derivative and its stated standard deviation, µW/N.
    seconds : float
        CPU seconds with the mechanics and the error.
    """

    COLUMNS: ClassVar = {
        "edges": ("edges", ""),
        "size": ("elements [mm]", "g"),
        "elements": ("number", "d"),
        "slope": ("slope [µW/N]", ".2f"),
        "error": ("stated error", ".2f"),
        "seconds": ("CPU s", ".0f"),
    }
    edges: str
    size: float
    elements: int
    slope: float
    error: float
    seconds: float


_PAGE = """\
# Rounded edges

For users who ask what fillets of a mould do to the limit of a load path, and to the number of elements of a slope.

{answer}

Written by `{command}`; do not edit by hand.

![A box whose edges are all rounded, cut open](gallery/rounded_edges.png)

The pad has one parallelepiped cell, 2.55 mm wide, with walls of 1 mm. `fillet` rounds the edge between roof and side
and the upright edges of the cell, `mouth_fillet` the edge of its mouth, and `outer_fillet` the upright and upper edges
of the outside. The picture shows all three, of 0.2 mm, at rest.

## Ends of load paths
The pad is loaded by {normal:.3g} N, then along x, without `self_contact`. A path ends where the pad touches something
or becomes unstable; *second mesh* is the end of the message.

{ends}

An end whose message states no error depends on the elements: it is no limit of the sensor. With `self_contact` these
paths continue.

## Slopes along x
Slopes are derivatives of the reading with respect to `fx`, under {slope_at} N. The roof is Lambertian and reflects
90 %; all other walls absorb. Errors are standard deviations, due to elements and light.

{slopes}
"""


def ends(starting: Callable[[str], None] | None = None) -> Iterator[EndRow]:
    """Follow the load paths of boxes to their ends, and yield a row for each; ``starting`` is called with the name of a
    row before it is measured.
    """
    for edges, fillets in EDGES.items():
        for size in SIZES:
            if starting:
                starting(f"end, {edges}, elements of {size:g} mm")
            yield _end(edges, Pad(rows=1, columns=1, **fillets), size)


def _end(edges: str, pad: Pad, size: float) -> EndRow:
    start, material = time.process_time(), NeoHookean()
    elements = len(pad_path(pad, material, SPREAD_FORCE, size).mesh.tets)
    end, reason, said = FURTHEST[0], "reaches it", ""
    try:
        load_path(pad, material, [FURTHEST], mesh_size=size)
    except LoadPathEnds as ended:
        assert ended.value is not None
        end, message = float(ended.value[0]), str(ended)
        reason = f"touches {ended.contact.what}" if ended.contact else "cannot be loaded further"
        said = message[at:] if (at := message.find("On elements of")) >= 0 else ""
    return EndRow(edges, size, elements, end, reason, said, time.process_time() - start)


def edge_slopes(starting: Callable[[str], None] | None = None) -> Iterator[EdgeSlopeRow]:
    """Compute slopes of boxes along x, and yield a row for each; ``starting`` is called with the name of a row before
    it is measured.
    """
    roof = {"scattering": "lambertian", "reflectance": 0.9}
    for edges in SLOPE_EDGES:
        for size in SLOPE_SIZES:
            if starting:
                starting(f"slope, {edges}, elements of {size:g} mm")
            start, pad = time.process_time(), Pad(rows=1, columns=1, **EDGES[edges])
            scene = dome_scene("parallelepiped", roof, force=list(SLOPE_AT), mesh_size=size, **EDGES[edges])
            result = derivatives_by([rates(scene, "fx")], scene.load())
            elements = len(pad_path(pad, NeoHookean(), SPREAD_FORCE, size).mesh.tets)
            slope, error = (1e6 * float(values[0, 0]) for values in (result.values, result.standard_errors))
            yield EdgeSlopeRow(edges, size, elements, slope, error, time.process_time() - start)


def write_page(ends: Sequence[EndRow], slopes: Sequence[EdgeSlopeRow], file: Path, command: str) -> None:
    """Write both tables as a page.

    Parameters
    ----------
    ends : sequence of EndRow
        Rows of the first table.
    slopes : sequence of EdgeSlopeRow
        Rows of the second table.
    file : Path
        Page, which is replaced.
    command : str
        Command that the page names as its source.
    """
    tables = [
        markdown_table(headings(kind), map(cells, rows), headings(kind)[:1])
        for kind, rows in ((EndRow, ends), (EdgeSlopeRow, slopes))
    ]
    slope_at = "({:g}, {:g}, {:g})".format(*SLOPE_AT)
    words = {"command": command, "answer": answer(ends, slopes), "normal": -FURTHEST[2], "slope_at": slope_at}
    write_text(file, _PAGE.format(ends=tables[0], slopes=tables[1], **words))


def answer(ends: Sequence[EndRow], slopes: Sequence[EdgeSlopeRow]) -> str:
    """The result of both tables in words: how much the ends and the slopes change between the element sizes."""
    sentences = []
    for edges in EDGES:
        values = [row.end for row in ends if row.edges == edges]
        if len(values) > 1:
            finest = values[-2:]
            change = abs(finest[1] - finest[0]) / finest[1]
            sentences.append(
                f"With edges *{edges}*, the end of the load path is at {min(values):.2f} to {max(values):.2f} N on "
                f"{len(values)} meshes, and changes by {change:.0%} between the two finest."
            )
    for edges in SLOPE_EDGES:
        rows = [row for row in slopes if row.edges == edges]
        if len(rows) > 1:
            change = abs(rows[0].slope - rows[-1].slope) / abs(rows[-1].slope)
            sentences.append(
                f"Edges *{edges}*: the slope along x of {rows[0].elements} elements differs by {change:.1%} from that "
                f"of {rows[-1].elements}."
            )
    return "\n".join(f"- {sentence}" for sentence in sentences)
