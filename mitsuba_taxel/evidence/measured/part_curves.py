"""Computed curves of photo-reflectors compared with those of their datasheets: the current against the distance of a
reflector, and against the position of a mirror's edge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.parts import MirrorRays, Part, distance_model, mirror_rays, part_names, read_datasheet
from mitsuba_taxel.parts.part import Side
from mitsuba_taxel.parts.refraction import passes_window, sobol_points
from mitsuba_taxel.plots.figures import COLOURS, panel_axes

EDGE_WIDTH = 0.427
"""Measured width along x, from 10 to 90 % of the current, of the edge of a mirror over a VCNT2020, mm."""
EDGE_HEIGHT = 1.0
"""Height of that mirror, mm; assumed, as the source of the width does not state it."""
ALLOWED = 0.03
"""Asked miss of the distance curve, relative to its peak."""
NEAR = 0.005
"""Difference of that miss from the least one within which candidates are as good."""
WHITE_PAPER = (
    (0.25, 0.556), (0.4, 0.870), (0.5, 0.964), (0.6, 0.993), (0.75, 0.980), (1.0, 0.871), (1.25, 0.756), (1.5, 0.642),
    (2.0, 0.428), (2.5, 0.302), (3.0, 0.224), (4.0, 0.132), (5.0, 0.088),
)  # fmt: skip
"""Current of the QRE1113 under white paper, by height in mm: figure 1 of its datasheet, the full line."""


@dataclass(frozen=True)
class PartRow:
    """A photo-reflector, with its computed distance curve and the curve of its datasheet.

    Attributes
    ----------
    name, reflector : str
        Name of the part, and the reflecting surface with which the curve was measured.
    heights, sheet, model : (N,) ndarray
        Heights of the reflector in mm; currents of the datasheet; and currents computed from the positions of the dies.
        Currents are relative to the largest. ``model`` is empty if the geometry is unknown.
    missing : tuple[str, ...]
        Dimensions of the part that are unknown.
    """

    name: str
    reflector: str
    heights: np.ndarray
    sheet: np.ndarray
    model: np.ndarray | None
    missing: tuple[str, ...] = ()

    @property
    def worst(self) -> tuple[float, float]:
        """Largest difference between the computed current and that of the datasheet, relative to the largest current,
        and the height in mm at which it occurs."""
        assert self.model is not None
        difference = self.model - self.sheet
        index = int(np.abs(difference).argmax())
        return float(difference[index]), float(self.heights[index])


@dataclass(frozen=True)
class Explanation:
    """A hypothesis about the light path in a photo-reflector VCNT2020 (which surfaces emit, and which receive), and the
    curves that it predicts.

    Attributes
    ----------
    name : str
        Description of the hypothesis.
    miss : float
        Largest difference from the distance curve of the datasheet, relative to its peak.
    x_width, y_width : float
        Distance along x and y that the edge of a mirror moves while the current rises from 10 to 90 %, mm.
    curve : (N,) ndarray
        Computed currents at the rows of the datasheet, relative to the largest.
    """

    name: str
    miss: float
    x_width: float
    y_width: float
    curve: np.ndarray


def part_rows() -> list[PartRow]:
    """Compute the curves of all parts of the catalogue that have a distance curve.

    Returns
    -------
    list[PartRow]
        One row per part, and one for the QRE1113 under white paper.
    """
    rows = []
    for name in part_names():
        sheet = read_datasheet(name)
        if sheet.distance_curve:
            heights, currents = np.array(sheet.distance_curve).T
            model = None if sheet.missing else _relative(sheet.with_numbers({}), heights)
            rows.append(PartRow(name, sheet.distance_reflector, heights, currents, model, sheet.missing))
    heights, currents = np.array(WHITE_PAPER).T
    paper = replace(read_datasheet("qre1113").with_numbers({}), distance_reflector="white card")
    rows.append(PartRow("qre1113, predicted", "white paper", heights, currents, _relative(paper, heights)))
    return rows


def _relative(part: Part, heights: np.ndarray) -> np.ndarray:
    """Computed currents (N,) of a part at N heights of a reflector, relative to the largest current in the range of
    heights."""
    model = distance_model(part, heights)
    nearest = heights[np.abs(heights - heights[model.argmax()]).argsort()][:3]
    around = np.linspace(nearest.min(), nearest.max(), 12)
    return model / max(model.max(), distance_model(part, around).max())


def explanations() -> list[Explanation]:
    """Compute the curves of several hypotheses about the light path in a VCNT2020. Their dimensions were found by a
    search.

    Returns
    -------
    list[Explanation]
        One entry for each hypothesis.
    """
    part = read_datasheet("vcnt2020").with_numbers({})

    def dies(sizes: tuple[float, float], length: float, depths: tuple[float, float], index: float = 1.5) -> Part:
        sides = {
            role: replace(getattr(part, role), die_width=size, die_length=length or size, die_depth=depth)
            for role, size, depth in zip(("emitter", "detector"), sizes, depths, strict=True)
        }
        return replace(part, resin_index=index, **sides)

    def whole(side: Side) -> Side:
        return replace(side, y=0.0, die_width=side.window_width, die_length=side.window_length, die_depth=0.0)

    windows = replace(part, emitter=whole(part.emitter), detector=whole(part.detector))
    rows: list[tuple[str, Callable[[float], MirrorRays]]] = [
        (name, partial(mirror_rays, of))
        for name, of in (
            ("dies of 0.35 and 0.40 mm, 0.1 mm deep (the catalogue)", part),
            ("dies of 0.29 and 0.63 mm, 0.62 mm deep, index 1.3", dies((0.289, 0.634), 0, (0.615, 0.615), 1.3)),
            ("dies of 0.77 mm, 0.1 mm deep", dies((0.77, 0.77), 0, (0.1, 0.1))),
            ("squares of 0.74 and 0.82 mm at the surface", dies((0.742, 0.820), 0, (0.003, 0.002))),
            ("0.70 and 0.92 mm along x, 1.0 mm along y", dies((0.703, 0.917), 1.0, (0.015, 0.042))),
            ("0.71 and 0.89 mm along x, 1.65 mm along y", dies((0.710, 0.891), 1.65, (0.057, 0.065))),
            ("whole windows, evenly", windows),
        )
    ]
    rows += [
        (f"a scattering surface {depth:g} mm above small dies", partial(scattered_rays, part, depth))
        for depth in (0.2, 0.6)
    ]
    return [_explanation(part, name, rays) for name, rays in rows]


def scattered_rays(part: Part, depth: float, height: float) -> MirrorRays:
    """Rays between two scattering windows above small dies, by way of a mirror. The windows scatter by Lambert's law:
    the emitter irradiates its window from below, and the detector sees its window from below.

    Parameters
    ----------
    part : Part
        Emitter and detector; both dies count as points.
    depth : float
        Depth of the dies below the scattering surface, mm.
    height : float
        Height of the mirror, mm.

    Returns
    -------
    MirrorRays
        Points of reflection, and powers in an arbitrary unit.
    """
    uniform, places, weight = sobol_points(4), [], np.ones(1)
    for side, numbers in ((part.emitter, uniform[:, :2]), (part.detector, uniform[:, 2:])):
        place = numbers * [side.window_width, side.window_length] + side.window_centre
        squared = np.sum((place - [side.x, side.y]) ** 2, axis=1)
        weight = weight * passes_window(side, place) * depth**2 / (squared + depth**2) ** 2
        places.append(place)
    squared = np.sum((places[0] - places[1]) ** 2, axis=1)
    return MirrorRays((places[0] + places[1]) / 2, weight * (2 * height) ** 2 / (4 * height**2 + squared) ** 2)


def _explanation(part: Part, name: str, rays: Callable[[float], MirrorRays]) -> Explanation:
    heights, sheet = np.array(part.distance_curve).T
    curve = np.array([rays(height).power.sum() for height in heights])
    around = max(rays(height).power.sum() for height in np.linspace(0.4, 0.7, 7))
    curve /= max(around, curve.max())
    at = rays(EDGE_HEIGHT)
    return Explanation(name, float(np.abs(curve - sheet).max()), edge_width(at, 0), edge_width(at, 1), curve)


def edge_width(rays: MirrorRays, axis: int) -> float:
    """Distance in mm that the edge of a mirror moves along an axis while the current rises from 10 to 90 %."""
    order = np.argsort(rays.places[:, axis])
    passed = np.cumsum(rays.power[order]) / rays.power.sum()
    low, high = np.interp([0.1, 0.9], passed, rays.places[order, axis])
    return float(high - low)


HEADINGS = ("part", "reflector", "brightest at [mm]", "computed [mm]", "largest difference [% of the peak]", "at [mm]")


def cells(row: PartRow) -> list[str]:
    """Format a part as table cells, in the order of `HEADINGS`.

    Parameters
    ----------
    row : PartRow
        A part.

    Returns
    -------
    list[str]
        Cells.
    """
    at = f"{row.heights[row.sheet.argmax()]:g}"
    if row.model is None:
        return [row.name, row.reflector, at, "-", "geometry unknown", "-"]
    worst, height = row.worst
    return [row.name, row.reflector, at, f"{row.heights[row.model.argmax()]:g}", f"{100 * worst:+.1f}", f"{height:g}"]


EXPLANATION_HEADINGS = ("what lights and receives", "distance curve, miss [%]", "edge along x [mm]", "along y [mm]")


def explanation_cells(row: Explanation) -> list[str]:
    """Format a hypothesis as table cells, in the order of `EXPLANATION_HEADINGS`.

    Parameters
    ----------
    row : Explanation
        A hypothesis.

    Returns
    -------
    list[str]
        Cells.
    """
    return [row.name, f"{100 * row.miss:.1f}", f"{row.x_width:.3f}", f"{row.y_width:.3f}"]


def write_page(rows: list[PartRow], candidates: list[Explanation], page: Path, command: str) -> None:
    """Write the page that compares computed curves with those of datasheets, and its picture beside it.

    Parameters
    ----------
    rows : list[PartRow]
        Parts.
    candidates : list[Explanation]
        Hypotheses for the VCNT2020, in the order of `explanations`.
    page : Path
        File of the page, which ends in .md.
    command : str
        Command that writes it.
    """
    picture = page.with_suffix(".png")
    _plot(rows, candidates, picture)
    wide = [row for row in candidates if abs(row.x_width - EDGE_WIDTH) < 0.02 * EDGE_WIDTH]
    best = min(row.miss for row in wide)
    fitting = [row for row in wide if row.miss < best + NEAR]
    predicted = (min(row.y_width for row in fitting), max(row.y_width for row in fitting))
    text = _PAGE.format(
        command=command, picture=picture.name, parts=markdown_table(list(HEADINGS), map(cells, rows)),
        candidates=markdown_table(list(EXPLANATION_HEADINGS), map(explanation_cells, candidates)),
        width=EDGE_WIDTH, height=EDGE_HEIGHT, low=predicted[0], high=predicted[1], allowed=100 * ALLOWED,
        best=100 * best, whole=100 * candidates[6].miss,
        square=candidates[3].y_width, long=candidates[5].y_width, near=100 * (best + NEAR),
    )  # fmt: skip
    write_text(page, text)


def _plot(rows: list[PartRow], candidates: list[Explanation], file: Path) -> None:
    from mitsuba_taxel.base.files.atomic import replacing

    axes = list(panel_axes(2, 3, sharex=False, size=(4.4, 3.2)).flat)
    for ax, row in zip(axes, rows, strict=False):
        ax.plot(row.heights, 100 * row.sheet, "o", color=COLOURS[1], markersize=4, label="datasheet")
        if row.model is not None:
            ax.plot(row.heights, 100 * row.model, color=COLOURS[0], label="these dies")
        ax.set_title(f"{row.name}: {row.reflector}", fontsize="medium")
        ax.set_xlabel("height above the windows [mm]")
        ax.set_ylabel("current [% of the largest]")
        ax.legend(fontsize="small")
    last = axes[-1]
    for number, candidate in enumerate(candidates):
        place = candidate.x_width, 100 * candidate.miss
        last.plot(*place, "o", color=COLOURS[number % len(COLOURS)])
        last.annotate(str(number + 1), place, xytext=(4, 3), textcoords="offset points")
    last.axvline(EDGE_WIDTH, color="black", lw=0.8)
    last.axhline(100 * ALLOWED, color="black", lw=0.8, ls="--")
    last.set_xlabel("edge of a mirror along x, 10 to 90 % [mm]")
    last.set_ylabel("miss of the distance curve [%]")
    last.set_title("vcnt2020: candidates by row of the table", fontsize="medium")
    with replacing(file) as new:
        last.figure.savefig(new, format="png")


_PAGE = """\
# Parts beside their datasheets

For users of real photo-reflectors who must know how well the dies of the catalogue reproduce a datasheet.

Written by `{command}`; do not edit by hand.

![Currents over distance, and candidates for the VCNT2020]({picture})

{parts}

Currents are relative to the largest. The file of each part says where its numbers are from, and what is unknown. Sizes
and depths of dies are in no datasheet. They were fitted to the curve, which hardly determines the sizes. So a small
difference does not prove the geometry.

- **CNY70.** Windows of 1.8 mm lie 1 mm below a rim. Dies of 0.3 mm, 1 mm deep, are the best of 24 combinations; with
  dies at the windows, the difference is a third of the peak. Light that the rim reflects is unknown and not modelled.
- **QRE1113.** Its datasheet has two curves. Dies and depth are fitted to that under a mirror, and the other, under
  white paper, is then predicted. The prediction misses by an eighth of the peak below 0.5 mm, and is a few percent too
  high beyond 1 mm: the fit does not hold near the part. Its windows, like those of the CNY70, may lie below a rim.
- **TCRT5000.** Its two domes are lenses with tilted axes, and their distance is not stated. A part of this program has
  flat windows, so that a reading is refused. Only the datasheet's curve is shown.
- **VCNT2020.** See below.

## The emitting and receiving surfaces of a VCNT2020

The datasheet's two curves together are reproduced only by surfaces about twice as wide as the dies of the catalogue.
They are 0.7 to 0.9 mm wide, lie at the windows, less than 0.05 mm deep, and emit by Lambert's law. The best of them
has the measured width along x, and differs from the distance curve by {best:.1f} % of the peak; {allowed:g} % was
the target.

The second curve of the datasheet is that of the edge of a mirror that moves along x: the current rises from 10 to 90 %
within {width} mm. This width is determined by the sizes of the surfaces, and hardly by their depth or the height of the
mirror (here {height:g} mm, assumed), because a ray meets the mirror halfway between its ends on the emitter and on the
detector.

The table has a row for each candidate. It shows the largest difference from the distance curve, in percent of the peak,
and the widths of the edge along x and y. Candidates were found by minimising that difference for a given width along x:

{candidates}

**Excluded** are:

- small dies below clear resin, although some fit the distance curve better than any other: the edge is then about half
  as wide as measured;
- wide dies that lie deeper: the current near the part is then wrong by a tenth of the peak;
- whole windows, evenly lit, as they would be by much scattering in the resin: the difference is {whole:.1f} % of the
  peak;
- a scattering surface above small dies: close to the dies, its edge is too narrow; far above them, its difference is as
  large as that of whole windows.

The two curves do not show whether these surfaces are large dies, the cup of a reflector, or resin that is lit in it.

**Prediction, written before any comparison.** From 10 to 90 % of the current, the edge of a mirror along y is
{square:.2f} mm wide if the surfaces are squares, as dies are. Lengths up to 1 mm fit as well (to {near:.1f} %), so that
{low:.2f} to {high:.2f} mm are possible. The middle is on the line of the dies, 0.3 mm from the middle of the body. If
the whole length of the windows were lit, the width would be {long:.2f} mm or more.

**In scenes.** The part `vcnt2020` keeps its dies below resin, because under a wide reflector its readings are as near
to the datasheet as those of the wide surfaces. At small structures, such as the edge of a roof or a narrow stripe, its
light is half as wide as that of the part. For these, copy its file and set `die_width` and `die_length` to 0.74
(emitter) and 0.82 (detector), and `die_depth` to 0: the LED then follows Lambert's law in air over the entire square.
"""
