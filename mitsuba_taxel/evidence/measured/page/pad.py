"""A section of the page of measured sensors: the pad under its indenter."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mitsuba_taxel.base.markdown import markdown_table
from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.evidence.measured import bench_pad, measured, validation_figures
from mitsuba_taxel.evidence.measured.pad_comparison import FINER, MAP_TRAVEL, Compared, Results, ring
from mitsuba_taxel.evidence.measured.taxel_spread import ROUNDING, band
from mitsuba_taxel.evidence.paper.page.words import paragraph

FORCE_TARGET, CHANGE_TARGET, MAP_TARGET, PREDICTED_TARGET = 5.0, 5.0, 5.0, 10.0
"""What counts as agreement, set before the fit: in percent of the largest, and points of the map."""
ALIKE = 1.5
"""Misfit, relative to the least, of pairs of unknowns that the page tells too."""


def pad_section(found: Results, pictures: Path) -> str:
    """The section of the page; its figures are written to the folder ``pictures``."""
    validation_figures.pressed(found.taxels, pictures / "pressed.png")
    validation_figures.maps(found, pictures / "map.png")
    taxels = ", ".join(map(str, found.taxels))
    fitted, collar = measured.PRESSED, f"{measured.COLLAR_HEIGHT:g} mm"
    points = len(measured.PRESSES[fitted].forces)
    tried = len(found.found.tried)
    x, y = (f"{place:+.2f} mm" for place in found.offset)
    held = f"{100 * measured.HELD_SHARE:.1f} %; here by {100 * found.held:.1f} %"
    below = measured.CORE_HEIGHT - measured.COLLAR_HEIGHT
    heads = ["", *(f"column {number}" for number in range(1, bench_pad.SIDE + 1))]
    return f"""\
## A real pad under its indenter
![Force against travel, and change of the voltage against force](validation/pressed.png)

*Marks are measured, lines computed.* A pad of 5 x 5 cells with photo-reflectors NJL5908AR, pressed slowly at
its taxels {taxels}. Its height, its silicone and the indenter are not stated.

**Fitted to taxel {fitted} alone**, to its force and its reading at {points} travels, by {tried} paths of
finite elements; the modulus has a closed form, as forces are proportional to it. A record begins where the robot
noticed the contact, and how late that is, is found as well:

{markdown_table(["unknown", "value"], _unknowns(found))}

{paragraph(_valley(found))}

The indenter is taken as a ball of that radius without friction, the silicone as neo-Hookean with nu = 0.49. Collars of
the rigid grid reach {collar} into the cells and hold the walls between them: the model is glued at their
tops, {collar} above the dies and {below:g} mm below the roofs. The grid is opaque but for windows of
{measured.WINDOW:g} mm.
Roofs reflect isotropically and all else absorbs, as in the paper; the LED is Lambertian. Left out: the silicone
around the grid below the tops of the collars, friction, gaps beside the collars, light through the silicone, and
compliance of the robot. Voltages are compared relative to rest: the circuit is linear up to 3 V of its 3.3 V, so no
gain is needed, and no reading comes near saturation.

{"".join(_pressed(taxel, one) for taxel, one in found.taxels.items())}
{paragraph(_spread(found))}

{paragraph(_errors(found))}

### All taxels
![Changes of all taxels while taxel 13 is held](validation/map.png)

While taxel {fitted} is held at {measured.HELD_AT:g} mm its voltage changes by {held}. All taxels in percent
of that, in their places, measured / here (at {MAP_TRAVEL:g} mm), with ± one standard deviation of what is told below:

{markdown_table(heads, _map_rows(found))}

Fitted to the asymmetry of the four nearest taxels: the indenter stands {x} along x and {y} along y off the
middle of taxel {fitted}. All else in the map is predicted.

{paragraph(_map_words(found))}

{paragraph(_band_words(found))}
"""


def _unknowns(found: Results) -> list[list[str]]:
    height, radius, late = (
        with_error(value, error)
        for value, error in zip([*found.found.unknowns, found.found.late], found.found.deviations, strict=True)
    )
    return [
        ["height of the silicone above the dies", f"{height} mm"],
        ["radius of the end of the indenter", f"{radius} mm"],
        ["Young's modulus", f"{found.found.modulus:.3g} MPa"],
        ["travel from the first contact to where the record begins", f"{late} mm"],
    ]


def _valley(found: Results) -> str:
    """What else was tried and fits nearly as well."""
    best = tuple(found.found.unknowns)
    others = [
        f"{height:g} mm with {radius:g} mm ({100 * misfit:.1f} %)"
        for (height, radius), misfit in found.found.tried.items()
        if (height, radius) != best and misfit < ALIKE * found.found.misfit
    ]
    alike = f"; nearly as well: {', '.join(others)}. Height and radius are hardly told apart" if others else ""
    return f"Root mean square of the residuals, of the largest values: {100 * found.found.misfit:.1f} %{alike}."


def _pressed(taxel: int, one: Compared) -> str:
    fitted = taxel == measured.PRESSED
    force_target, change_target = (FORCE_TARGET, CHANGE_TARGET) if fitted else (PREDICTED_TARGET, PREDICTED_TARGET)
    columns = [
        (one.measured.travel, ".3f"),
        (one.measured.force, ".2f"),
        (one.computed.force, ".2f"),
        (one.force_error, "+.1f"),
        (100 * one.measured.change, ".2f"),
        (100 * one.change_at_force, ".2f"),
        (one.change_error, "+.1f"),
    ]
    rows = np.transpose([[_shown(value, form) for value in values] for values, form in columns]).tolist()
    half = ["measured", "here", "difference [%]"]
    heads = ["travel [mm]", f"force [N] {half[0]}", *half[1:], f"change [%] {half[0]}", *half[1:]]
    end = f" The computed path ends early: {one.end}" if one.end else ""
    verdicts = " ".join(
        [_verdict("force", one.force_error, force_target), _verdict("change", one.change_error, change_target)]
    )
    how = "fitted" if fitted else "predicted"
    return f"""\
**Taxel {taxel}, {how}.** Force at equal travel, and change of the voltage at equal force in percent of that at
rest, {measured.PRESSES[taxel].at_rest:g} V; differences in percent of the largest:

{markdown_table(heads, rows)}

{paragraph(verdicts + end)}

"""


def _spread(found: Results) -> str:
    """How taxels differ at one force that all reach."""
    at = min(one.measured.force[np.isfinite(one.change_at_force)].max() for one in found.taxels.values())
    both = np.array(
        [
            (np.interp(at, one.measured.force, one.measured.change), np.interp(at, one.along.force, one.along.change))
            for one in found.taxels.values()
        ]
    ).T
    at_rest = np.array([measured.PRESSES[taxel].at_rest for taxel in found.taxels])
    volts = both * [at_rest, np.full(len(at_rest), measured.PRESSES[measured.PRESSED].at_rest)]
    there, here = (" / ".join(f"{100 * value:.1f}" for value in values) for values in both)
    there_volts, here_volts = (" / ".join(f"{value:.3f}" for value in values) for values in volts)
    return (
        f"At {at:.2f} N the changes of taxels {' / '.join(map(str, found.taxels))} are {there} % measured, {here} % "
        "here. The model knows no differences between parts and their places in the cells, nor where the indenter "
        "stood over the taxels that are predicted: it is put over the middle. In volts they are "
        f"{there_volts} V measured, {here_volts} V here if all have the rest voltage of taxel {measured.PRESSED}: off "
        f"by {' / '.join(f'{100 * (b / a - 1):+.0f}' for a, b in volts.T)} %, instead of "
        f"{' / '.join(f'{100 * (b / a - 1):+.0f}' for a, b in both.T)} % relative to rest. Parts of another gain would "
        f"change the voltage at rest and its change alike. {_light_at_rest(both, volts)}"
    )


def _light_at_rest(shares: np.ndarray, volts: np.ndarray) -> str:
    """What changes relative to rest, and in volts, (2, taxels) measured and here, tell about the light at rest."""
    off, off_in_volts = (float(np.abs(values[1] / values[0] - 1).max()) for values in (shares, volts))
    if off_in_volts >= off:
        return "Changes in volts differ no less than those relative to rest, so the light at rest does not explain it."
    return (
        "As the changes in volts differ less than those relative to rest, it may rather be a part of the light at rest "
        "which the load does not change that differs between taxels; three of them do not prove it. The model has no "
        "such light: roofs alone reflect."
    )


def _verdict(what: str, error: np.ndarray, target: float) -> str:
    worst = float(error[np.nanargmax(np.abs(error))])
    within = "within" if abs(worst) <= target else "**not within**"
    reached = np.isfinite(error).sum()
    part = "" if reached == len(error) else f", at the {reached} of {len(error)} points that the path reaches"
    return f"The {what} is off by {worst:+.1f} % at most{part}, {within} the target of {target:g} %."


def _shown(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "-"


def _errors(found: Results) -> str:
    """Numerical errors of the fitted path."""
    held = found.errors.isel(travel=-1)
    force = 100 * float(held.force_error / held.force)
    shares = (100 * np.abs(held.change_error / held.change)).values.reshape(bench_pad.SIDE, bench_pad.SIDE)
    middle, near = shares[bench_pad.SIDE // 2, bench_pad.SIDE // 2], ring(shares, 1)
    words = (
        f"Errors of the computation itself while taxel {measured.PRESSED} is held, from a second mesh and the noise of "
        f"the light: {force:.1f} % of the force, {middle:.1f} % of the change, {near:.1f} % of those of its neighbours."
    )
    there = found.finer.isel(travel=-1)
    further = 100 * float(there.force / held.force - 1)
    change = 100 * float((there.change / held.change).sel(taxel=measured.PRESSED) - 1)
    return (
        f"{words} On elements of {FINER:g} mm in place of {bench_pad.MESH_SIZE:g} mm the force in fact differs by "
        f"{further:+.1f} % and the change by {change:+.1f} %. The fitted height takes up an error in proportion to the "
        "change."
    )


def _map_rows(found: Results) -> list[list[str]]:
    rows = zip(measured.HELD_MAP, found.moved, band(found).deviation, strict=True)
    return [
        [f"row {number}", *(f"{a} / {round(b)} ± {c:.1f}" for a, b, c in zip(*row, strict=True))]
        for number, row in enumerate(rows, start=1)
    ]


def _map_words(found: Results) -> str:
    difference = found.moved - np.array(measured.HELD_MAP)
    middle = bench_pad.SIDE // 2
    near = np.abs(difference[middle - 1 : middle + 2, middle - 1 : middle + 2])
    centred = np.abs(found.centred - np.array(measured.HELD_MAP)).max()
    worst = np.unravel_index(int(np.abs(difference).argmax()), difference.shape)
    where = f"row {worst[0] + 1}, column {worst[1] + 1}"
    count = int((np.abs(difference) > MAP_TARGET).sum())
    verdict = (
        f"{count} of {difference.size - 1} differ by more than the target of {MAP_TARGET:g} points"
        if count
        else (f"all are within the target of {MAP_TARGET:g} points")
    )
    return (
        f"The largest difference is {difference[worst]:+.0f} points, in {where}; among the eight neighbours it is "
        f"{near.max():.0f}; {verdict}. Without the offset the largest would be {centred:.0f}. {_widest(found)}"
    )


def _band_words(found: Results) -> str:
    """What differences between taxels explain of the map."""
    one, difference = band(found), np.abs(found.moved - np.array(measured.HELD_MAP))
    times = difference / np.maximum(one.deviation, ROUNDING)
    row, column = np.unravel_index(int(times.argmax()), times.shape)
    shares = " / ".join(f"{share:.2f}" for share in one.own.values())
    missed = [f"{off:.1f} ({100 * one.chance(off):.0f} %)" for off in np.sort(times[difference > MAP_TARGET])]
    beyond = f" Those that are, are off by {', '.join(missed)} times the ±." if missed else ""
    return (
        f"Pressed themselves, taxels {' / '.join(map(str, one.own))} change {shares} times as much as computed: their "
        f"sensitivities differ by {100 * one.spread:.0f} % (one standard deviation). A number of the map is a ratio of "
        "two taxels, so that it may be off by the root of two times as much, and by the rounding of what is measured: "
        f"the ± of the table. By these, {one.expected_beyond(MAP_TARGET):.1f} taxels would be further off than "
        f"{MAP_TARGET:g} points, and a model that is exact but for them would have all within the target with a chance "
        f"of {100 * one.chance_of_none_beyond(MAP_TARGET):.1f} % only. In brackets is the chance of as much or more, "
        f"by Student's distribution, as {len(one.own)} taxels tell little of a spread.{beyond} By most times it is the "
        f"taxel in row {row + 1}, column {column + 1}, that is off: {times[row, column]:.1f} "
        f"({100 * one.chance(times[row, column]):.0f} %), "
        "where voltages hardly change."
    )


def _widest(found: Results) -> str:
    """What the pads that were tried tell about a map that is too narrow or too wide."""
    there, here = (ring(np.array(values), 1) for values in (measured.HELD_MAP, found.centred))
    height, near, held = found.widest
    means = f"The mean of the four nearest taxels is {there:.0f} % measured and {here:.0f} % here."
    if height == found.found.unknowns[0] or abs(there - here) <= MAP_TARGET:
        return means
    return (
        f"{means} Of the pads tried, that of {height:g} mm comes nearest with {near:.0f} %, but its taxel "
        f"{measured.PRESSED} changes by {100 * held:.1f} % while it is held. Which assumption is wrong, these data do "
        "not tell."
    )
