"""The page of a rerun: its tables and figures, and sentences whose numbers come from the studies."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.pads.pad import DEFAULT_MESH_SIZE
from mitsuba_taxel.reproduce import analog, figures, paper, plate
from mitsuba_taxel.reproduce.analysis import (
    PUBLISHED,
    against_table_one,
    expected_of_counting,
    explanations,
    least,
    nonlinearity_of,
    readings,
    skewness,
    table_one,
)
from mitsuba_taxel.reproduce.comparison import Fit, order, pairs_in_order
from mitsuba_taxel.reproduce.slopes import Sensitivity
from mitsuba_taxel.reproduce.variations import FINER_MESH, NOMINAL_LAW, NOMINAL_SPACING, choices
from mitsuba_taxel.studies import stage_totals
from mitsuba_taxel.studies.files import make_folder, replacing

Found = Mapping[str, Any]
"""Studies by the name of their part, as :func:`mitsuba_taxel.reproduce.parts.complete` gives them."""

NEAR_THE_DATASHEET = 0.03
"""How far in mm a curve over height may peak from where the datasheet's does, to be called consistent with it."""

_HEAD = """\
# The paper, rerun

Written by `{command}`; do not edit by hand. Every number and every comparison in the text comes from the runs.

*Multiphysics Simulation for the Optimization of an Optoelectronic-Based Tactile Sensor* simulates a pad of 3 x 3 cells
on photo-reflectors with a commercial suite. Here are its figures and tables from `mitsuba_taxel`, beside its numbers.
The paper does not say where LED and phototransistor lie in the package, which way round, how large the dark
centre of the LED is, which of two "conical" emission laws it used, or Poisson's ratio. The *nominal* sensor is that
of `pad.xml`: {spacing:g} mm between the dies, LED at -x, phototransistor's long side along x, dark centre 0.1 mm, LED
uniform per solid angle up to 88 degrees, neo-Hookean silicone with nu = 0.49, roofs isotropic, all else absorbing.
Nothing is fitted to the paper's numbers. Errors are one standard error of the light; 1 W per LED. The source power
scales all readings and slopes alike and needs no computation.
"""


def write_page(found: Found, docs: Path, command: str) -> Path:
    """Write ``paper.md`` and, in ``paper/``, the figures of the parts that are there; returns the page."""
    pictures = docs / "paper"
    make_folder(pictures)
    sections = [_HEAD.format(command=command, spacing=NOMINAL_SPACING)]
    for wanted, section in SECTIONS:
        if all(name in found for name in wanted):
            sections.append(section(found, pictures))
    page = docs / "paper.md"
    with replacing(page) as file:
        file.write_text("\n".join(sections), encoding="utf-8")
    return page


def _optics(found: Found, pictures: Path) -> str:
    figures.plate_curves(found["fig4"], "z", "z", "height z [mm]", pictures / "fig4.png")
    for part, axis in (("fig5", "x"), ("fig6", "y")):
        label = f"edge distance along {axis} [mm]"
        figures.plate_curves(found[part], f"offset_{axis}", "edge", label, pictures / f"{part}.png")
    return f"""\
## Figs. 4 to 6: the photo-reflector under a mirror plate
![Power over height](paper/fig4.png)

**Fig. 4.** Power, normalised to its largest, against height. The first height is {paper.HEIGHT_STEP:g} mm: at z = 0 the
plate lies on LED and phototransistor, no light passes, and the reading is 0. Grey: where the datasheet's curve peaks.
Bands are two standard errors.

![Power over an edge along x](paper/fig5.png)
![Power over an edge along y](paper/fig6.png)

**Figs. 5 and 6.** The plate at {paper.EDGE_HEIGHT:g} mm covers what lies beyond its edge. The edge distance is how far
the edge has moved in over the package from the package's own edge, along x from the LED's side: at 0 the whole package
is covered. (The paper speaks of "the space among the reflective plane and the photo-reflector edges".)
"""


def _peaks(found: Found, pictures: Path) -> str:
    peaks = plate.peaks(found["peak"])
    figures.peak_positions(peaks, pictures / "peak.png")
    shown = [*plate.SPACINGS]
    rows = [
        [
            f"`{law}`",
            *(with_error(*by_spacing[spacing]) for spacing in shown),
            _within(plate.spacing_for(by_spacing, paper.PEAK_HEIGHT)),
        ]
        for law, by_spacing in peaks.items()
    ]
    head = ["LED", *(f"peak [mm] at {spacing:g} mm" for spacing in shown), "spacing [mm] for a peak at 0.30 mm"]
    least, most = min(plate.PEAK_SPACINGS), max(plate.PEAK_SPACINGS)
    return f"""\
### Die spacing and emission law go together
![Height of the peak](paper/peak.png)

{_table(head, rows)}

The peak of a cubic in ln z through ln(power) above {plate.NEAR_PEAK:.0%} of the largest; die spacings from {least:g} to
{most:g} mm, which is what the package holds. The datasheet's peak is a property of the part; the pairs in the last
column have it, and it alone cannot tell between them.
"""


def _within(spacing: plate.Peak) -> str:
    return with_error(*spacing) if math.isfinite(spacing.at) else "none"


def _nominal(found: Found, pictures: Path) -> str:
    nominal, table = found["nominal"], table_one(found["nominal"])
    expected = expected_of_counting(nominal)
    figures.normal_curves({cell: paths["fz"] for cell, paths in nominal.items()}, pictures / "fig9.png")
    figures.tangential_curves(nominal, found.get("beyond"), pictures / "tangential.png")
    figures.sensitivities(table, expected, pictures / "table1.png")
    head = ["shape", "force", "paper [µW/N]", "here [µW/N]", "here / paper", "mean slope here [µW/N]", "steepest at"]
    rows = []
    for kind, published in PUBLISHED.items():
        for cell in paper.CELLS:
            one = table[kind][cell]
            ratio = with_error(one.max_slope / published[cell], one.max_slope_error / published[cell])
            mean = _micro(one.mean_slope, one.mean_slope_error)
            place = f"taxel {one.taxel}, {one.at:g} N"
            rows.append([cell, kind, f"{1e6 * published[cell]:.3g}", _steepest(one), ratio, mean, place])
    direction = [[cell, *(_steepest(table[path][cell]) for path in _TANGENTIAL)] for cell in paper.CELLS]
    return f"""\
## Fig. 9 and Table 1: four shapes under load
![Power under normal force](paper/fig9.png)

![Change of power under tangential force](paper/tangential.png)

**Tangential forces at -8 N**: change of power of the corner taxel at (+x, +y) and of the centre. Solid: as far as the
paper's solver went.

![Sensitivities](paper/table1.png)

{_table(head, rows)}

The maximum slope is that of all nine curves over steps of 0.5 N, of polynomials through them that leave no
significant term out (of degree {_degrees(table)}). Tangential: the steeper of x and y.

{_table(["shape", *(f"{_NAMES[path]} [µW/N]" for path in _TANGENTIAL)], direction)}

{_orders(table)}

{_cost(nominal)}
"""


_TANGENTIAL = ("fx", "fy", "resultant")
_NAMES = {"fz": "normal", "fx": "along x", "fy": "along y", "resultant": "along the diagonal"}


def _micro(value: float, error: float) -> str:
    """A number and its error in millionths of its unit."""
    return with_error(1e6 * value, 1e6 * error)


def _steepest(one: Sensitivity) -> str:
    return _micro(one.max_slope, one.max_slope_error)


def _degrees(table: Mapping[str, Mapping[str, Sensitivity]]) -> str:
    degrees = [one.degree for kind in PUBLISHED for one in table[kind].values()]
    return f"{min(degrees)} to {max(degrees)}"


def _orders(table: Mapping[str, Mapping[str, Sensitivity]]) -> str:
    """Sentences that set the order of the shapes against the paper's."""
    lines = []
    for kind, published in PUBLISHED.items():
        values = {cell: one.max_slope for cell, one in table[kind].items()}
        ours = order(values, {cell: one.max_slope_error for cell, one in table[kind].items()})
        theirs = sorted(published, key=lambda cell: -published[cell])
        same, pairs = pairs_in_order(values, published)
        lines.append(
            f"- **{kind}**: here {' > '.join(ours.names)} (probability {ours.certainty:.3f}, errors taken as "
            f"independent); paper {' > '.join(theirs)}. {same} of {pairs} pairs of shapes come in the same order."
        )
    return "\n".join(lines)


def _cost(nominal: Mapping[str, Mapping[str, Any]]) -> str:
    """Seconds by stage, and how good the readings are."""
    studies = [study for paths in nominal.values() for study in paths.values()]
    seconds: dict[str, float] = {}
    for study in studies:
        for stage, value in stage_totals(study).items():
            seconds[stage] = seconds.get(stage, 0.0) + value
    wall = sum(float(study.attrs["wall_seconds"]) for study in studies)
    light, total = (
        max(float((study[name] / study.power).max()) for study in studies) for name in ("standard_error", "total_error")
    )
    roofs = max(float(study.roof_error.max()) for study in studies)
    sizes = sorted({float(study.attrs.get("mesh_size", DEFAULT_MESH_SIZE)) for study in studies})
    meshes = f"{sizes[0]:.2f} mm" + (f" to {sizes[-1]:.2f} mm" if len(sizes) > 1 else "")
    count = sum(study.power.size for study in studies)
    shares = ", ".join(f"{stage} {value:.0f} s" for stage, value in seconds.items())
    return (
        f"{count} readings took {wall:.0f} s ({shares}, summed over processes). The largest total error of a "
        f"reading is {total:.2%}, of which the light has at most {light:.2%}; the estimated error of the roofs' "
        f"displacement is at most {1e3 * roofs:.1f} µm, on finite elements of {meshes}."
    )


def _roofs(found: Found, pictures: Path) -> str:
    nominal = found["nominal"]
    figures.diagonal_maps(nominal, found["roofs"], pictures / "fig10.png")
    rows = []
    for cell in paper.CELLS:
        parts = skewness(nominal[cell]["resultant"])
        rows.append([cell, *(_micro(*part) for part in parts.values())])
    return f"""\
## Fig. 10: a force along the secondary diagonal
![Roofs and powers](paper/fig10.png)

Change from the state at -8 N when {paper.SHOWN_TANGENTIAL_FORCE:g} N along (1, 1) are added, taxels as they lie on the
board. The paper sees the largest difference between taxels 3 and 7, a medium one between the sides, and next to none
on the main diagonal:

{_table(["shape", "3 - 7 [µW]", "(2 + 6 - 4 - 8) / 2 [µW]", "largest of 1, 5, 9 from their mean [µW]"], rows)}
"""


def _beyond(found: Found, pictures: Path) -> str:
    rows = []
    for cell in paper.CELLS:
        ends = [float(study[path].max()) for path, study in found["beyond"][cell].items()]
        rows.append([cell, f"{paper.TANGENTIAL_LIMIT[cell]:g}", *(f"{end:g}" for end in ends)])
    said = "\n".join(
        f"- {cell}, {_NAMES[path]}: {reason}"
        for cell, paths in found["beyond"].items()
        for path, study in paths.items()
        for reason in study.attrs["failures"].splitlines()[:1]
    )
    return f"""\
### How far the load paths go
Largest tangential force in N that is borne at -8 N, in steps of 1 N, and where the paper's solver stopped:

{_table(["shape", "paper", *(_NAMES[path] for path in _TANGENTIAL)], rows)}

What stops them, at the first step that fails:
{said}
"""


def _variations(found: Found, pictures: Path) -> str:
    tables = {words: table_one(cells) for words, cells in found["variations"].items()}
    fits = {words: against_table_one(table) for words, table in tables.items()}
    figures.choices(tables, pictures / "choices.png")
    heights = _heights(found)
    columns = [(kind, cell) for kind in PUBLISHED for cell in paper.CELLS]
    head = [
        "choice",
        *(f"{cell[:4]}. {kind[0].upper()}" for kind, cell in columns),
        "order",
        "factor",
        "misfit",
        "peak",
    ]
    rows = []
    for words, table in tables.items():
        slopes = [_steepest(table[kind][cell]) for kind, cell in columns]
        orders = [pairs_in_order({c: s.max_slope for c, s in table[k].items()}, PUBLISHED[k]) for k in PUBLISHED]
        same = "+".join(str(one) for one, _ in orders)
        rows.append(
            [words, *slopes, same, f"{fits[words].scale:.3g}", f"{fits[words].misfit:.2f}", _height(heights[words])]
        )
    return f"""\
## Which unstated choices move Table 1
![Sensitivities under each choice](paper/choices.png)

Steepest slopes in µW/N of the corner and the centre taxel, between 0, 5, ... 20 N of normal force (N), and between 0, 4
and 8 N along x or y at -8 N (T). *Order*: pairs of shapes, of 6 + 6, that come in the paper's order. *Factor* is what
all must be multiplied by to come nearest to the paper's numbers (a source of so many watts), *misfit* the typical
factor that each is then still off by. *Peak*: height in mm at which the part reads most under a mirror plate.

{_table(head, rows)}

A sensor whose packages are turned by 90 degrees has x and y exchanged; Table 1 takes the steeper of the two.

{_influence(tables)}

{_unexplained(tables, fits, heights)}
"""


def _heights(found: Found) -> dict[str, plate.Peak]:
    """Where the curve over height peaks for die spacing and law of each choice; not a number where it is not known."""
    peaks = plate.peaks(found["peak"]) if "peak" in found else {}

    def height(values: Mapping[str, Any]) -> plate.Peak:
        if not peaks or {"hole", "detector_width", "body_reflectance"} & set(values):
            return plate.Peak(math.nan, math.nan)
        return peaks[values.get("law", NOMINAL_LAW)][values.get("spacing", NOMINAL_SPACING)]

    return {choice.words: height(choice.values) for choice in choices()}


def _height(peak: plate.Peak) -> str:
    return with_error(*peak) if math.isfinite(peak.at) else "-"


def _influence(tables: Mapping[str, Mapping[str, Mapping[str, Sensitivity]]]) -> str:
    """The single choices by how far they move the eight slopes."""
    nominal = tables["nominal"]

    def moved(words: str) -> float:
        logs = [
            math.log(least(tables[words][kind][cell]) / least(nominal[kind][cell]))
            for kind in PUBLISHED
            for cell in paper.CELLS
        ]
        return math.exp(math.sqrt(float(np.mean(np.square(logs)))))

    single = [choice.words for choice in choices() if choice.single]
    ranked = sorted(single, key=moved, reverse=True)
    listed = ", ".join(f"{words} ({moved(words):.2f})" for words in ranked)
    return f"Single choices by the typical factor by which they change a slope: {listed}."


def _unexplained(tables: Mapping[str, Any], fits: Mapping[str, Fit], heights: Mapping[str, plate.Peak]) -> str:
    """What the choices with the least misfit leave, number by number."""
    physical = [words for words in tables if words != FINER_MESH]
    consistent = [words for words in physical if abs(heights[words].at - paper.PEAK_HEIGHT) <= NEAR_THE_DATASHEET]
    groups = {"Of all choices": physical, "Of those that put the peak within 0.03 mm of the datasheet's": consistent}
    lines = []
    for group, names in groups.items():
        if names:
            best = min(names, key=lambda words: fits[words].misfit)
            ours = {(kind, cell): one for kind in PUBLISHED for cell, one in tables[best][kind].items()}
            rest = ", ".join(
                f"{cell} {kind} {PUBLISHED[kind][cell] / (fits[best].scale * least(one)):.2f}"
                for (kind, cell), one in ours.items()
            )
            lines.append(
                f"- {group}, the least misfit has *{best}*: {fits[best].misfit:.2f}, with a factor of "
                f"{fits[best].scale:.3g}. The paper's numbers are still these multiples of it: {rest}."
            )
    return "**What is left**\n\n" + "\n".join(lines)


def _analog(found: Found, pictures: Path) -> str:
    nominal, counted = found["nominal"], found["analog"]
    slopes, drawn, true, rows = {}, {}, {}, []
    for cell, study in counted.items():
        force, power = study.fz.values, study.power.values
        centre = nominal[cell]["fz"].sel(taxel=[5])
        reading = centre.power.transpose("fz", "taxel").values
        binomial = analog.binomial(reading, analog.RAYS, analog.REPETITIONS)
        slopes[cell], drawn[cell] = (analog.max_slopes(force, samples) for samples in (power, binomial))
        one = table_one({cell: {"fz": centre, "fx": centre.rename(fz="fx"), "fy": centre.rename(fz="fy")}})["fz"][cell]
        true[cell] = one.max_slope
        answer, test = analog.summary(slopes[cell]), analog.counting_test(power, analog.RAYS)
        rows.append(
            [
                cell,
                _steepest(one),
                _micro(answer.mean, answer.error),
                f"{1e6 * answer.spread:.0f}",
                f"{answer.mean / least(one):.3g}",
                f"{1e6 * analog.summary(drawn[cell]).mean:.0f}",
                f"{test.ratio:.3f} (p = {test.p:.2g})",
            ]
        )
    figures.repetitions(slopes, drawn, true, pictures / "analog.png")
    head = [
        "shape",
        "true [µW/N]",
        "mean answer [µW/N]",
        "spread [µW/N]",
        "answer / true",
        "binomial [µW/N]",
        "scatter",
    ]
    repetitions = next(iter(counted.values())).sizes["replicate"]
    return f"""\
## The paper's own procedure, {repetitions} times over
![Maximum slopes by counted rays](paper/analog.png)

`analog_tracer` counts {analog.RAYS} rays (the power of two next to 20 x 3000) for the centre taxel at each of the 41
normal forces, anew each time, and the maximum slope over steps of 0.5 N is taken:

{_table(head, rows)}

*Binomial*: the mean answer if readings are counts of n rays, of which a share p lands. *Scatter*: the variance of the
readings over p (1 - p) / n, and the chance of one so far from 1. A ray tracer that repeats its random numbers at every
step would have less noise.
"""


def _hypotheses(found: Found, pictures: Path) -> str:
    nominal = found["nominal"]
    table, means, expected = table_one(nominal), readings(nominal), expected_of_counting(nominal)
    rows, lines, factors = [], [], []
    for kind, published in PUBLISHED.items():
        fits = explanations(published, table[kind], expected[kind], means[kind])
        factors.append(fits["maximum slope with counting noise"])
        for words, fit in fits.items():
            factor = with_error(fit.scale, fit.scale_error)
            test = f"{fit.chi_square:.1f} / {fit.freedom} (p = {fit.p:.2g})"
            rows.append([kind, words, factor, test, f"{fit.misfit:.2f}"])
        best = min(fits, key=lambda words: fits[words].misfit)
        lines.append(f"- {kind}: nearest is the {best}, with a misfit of {fits[best].misfit:.2f}.")
    normal, tangential = factors
    ratio = tangential.scale / normal.scale
    error = ratio * math.hypot(tangential.scale_error / tangential.scale, normal.scale_error / normal.scale)
    ratios = [
        [
            cell,
            *(
                f"{values[cell] / values['parallelepiped']:.2f}"
                for kind in PUBLISHED
                for values in (
                    PUBLISHED[kind],
                    {c: math.sqrt(value) for c, value in means[kind].items()},
                    {c: one.mean for c, one in expected[kind].items()},
                )
            ),
        ]
        for cell in paper.CELLS
    ]
    head = ["shape", *(f"{kind}: {what}" for kind in PUBLISHED for what in ("paper", "root of reading", "counting"))]
    return f"""\
## Is Table 1 counting noise?
With {paper.RAYS} rays a reading p scatters by sqrt(p (1 - p) / n). The largest of many steps of 0.5 N is then mostly
noise, and goes with the square root of the reading. Three explanations of Table 1, each with one common factor free;
the factor of the last is the source's power in W, or whatever else scales:

{_table(["force", "explanation", "factor", "chi-square / freedom", "misfit"], rows)}

{chr(10).join(lines)}

Counting noise with one source and equal steps would give both kinds of force the same factor. The tangential one is
{with_error(ratio, error)} times the normal one, as if its steps had been of {paper.FORCE_STEP / ratio:.2g} N.

Relative to the parallelepiped:

{_table(head, ratios)}

*Counting*: the mean maximum slope of nine curves with {paper.RAYS} rays for each reading, by binomial counts about our
readings.
"""


def _experiments(found: Found, pictures: Path) -> str:
    table = table_one(found["nominal"])
    measured = {
        "normal": {cell: max(values) for cell, values in paper.MEASURED_NORMAL.items()},
        "tangential": {cell: max(values) for cell, values in paper.MEASURED_TANGENTIAL.items()},
    }
    rows = []
    for cell in paper.MEASURED_NORMAL:
        row = [cell]
        for kind, values in measured.items():
            one, first = table[kind][cell], table[kind]["parallelepiped"]
            row.append(f"{values[cell] / values['parallelepiped']:.3f}")
            row.append(f"{one.max_slope / first.max_slope:.3f}")
        percent = nonlinearity_of(found["nominal"][cell]["fz"])
        rows.append([*row, f"{paper.MEASURED_NONLINEARITY[cell]:g}", with_error(*percent)])
    lines = []
    for kind, values in measured.items():
        for who, others in (
            ("ours", {cell: one.max_slope for cell, one in table[kind].items()}),
            ("the paper's simulation", PUBLISHED[kind]),
        ):
            same, pairs = pairs_in_order(values, others)
            lines.append(f"- {kind}: {same} of {pairs} pairs in the order of the experiments by {who}.")
    head = ["shape", "normal: measured", "here", "tangential: measured", "here", "e_nl measured [%]", "here [%]"]
    return f"""\
## The paper's experiments (Tables 2 to 4)
Sensitivities relative to the parallelepiped's (of the most sensitive taxel; measured in V/N), and nonlinearity
(equation 7, from the end-point line up to 10 N). The sensor of the experiments has 6 x 2 cells, so that forces per cell
differ; ratios and orders can be compared, numbers cannot.

{_table(head, rows)}

{chr(10).join(lines)}
"""


SECTIONS: tuple[tuple[tuple[str, ...], Callable[[Found, Path], str]], ...] = (
    (("fig4", "fig5", "fig6"), _optics),
    (("peak",), _peaks),
    (("nominal",), _nominal),
    (("nominal", "roofs"), _roofs),
    (("beyond",), _beyond),
    (("variations",), _variations),
    (("nominal", "analog"), _analog),
    (("nominal",), _hypotheses),
    (("nominal",), _experiments),
)
"""Sections of the page, and the parts that each needs."""


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, [":--", *["--:"] * (len(head) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
