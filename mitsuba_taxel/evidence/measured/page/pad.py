"""Section of the page of measured sensors: force and readings of the pad under its indenter."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.evidence.measured import bench_pad, measured, validation_figures
from mitsuba_taxel.evidence.measured.pad_comparison import FINER, MAP_TRAVEL, PadComparison, TaxelComparison, ring
from mitsuba_taxel.evidence.measured.taxel_spread import ROUNDING, band
from mitsuba_taxel.evidence.paper.page.words import paragraph

FORCE_TARGET, CHANGE_TARGET, MAP_TARGET, PREDICTED_TARGET = 5.0, 5.0, 5.0, 10.0
"""Limits of agreement, set before the fit: in percent of the largest value, and in points of the map."""
ALIKE = 1.5
"""Misfit, relative to the least, up to which the page shows other pairs of unknowns."""


def pad_section(results: PadComparison, pictures: Path) -> str:
    """The section of the page of measured sensors on the pad under its indenter; its figures are written to the folder
    ``pictures``.
    """
    validation_figures.pressed(results.taxels, pictures / "pressed.png")
    validation_figures.maps(results, pictures / "map.png")
    taxels = ", ".join(map(str, results.taxels))
    fitted, collar = measured.PRESSED, f"{measured.COLLAR_HEIGHT:g} mm"
    points = len(measured.PRESSES[fitted].forces)
    tried = len(results.found.tried)
    x, y = (f"{offset:+.2f} mm" for offset in results.offset)
    hold_change = f"{100 * measured.HELD_SHARE:.1f} % (measured) and {100 * results.held:.1f} % (computed)"
    below = measured.CORE_HEIGHT - measured.COLLAR_HEIGHT
    heads = ["", *(f"column {number}" for number in range(1, bench_pad.SIDE + 1))]
    return f"""\
## A real pad under its indenter
![Force against travel, and change of the voltage against force](validation/pressed.png)

*Marks are measured, lines are computed.* A pad of 5 x 5 cells with photo-reflectors NJL5908AR was pressed slowly at its
taxels {taxels}. The model is fitted to taxel {fitted} alone; it predicts the other taxels.

**Fit.** The height of the pad, its silicone and the indenter are not published. The following unknowns are fitted to
the force and the reading of taxel {fitted} at {points} travels:

{markdown_table(["unknown", "value"], _unknowns(results))}

The last unknown is needed because the record begins when the robot detects the contact. The fit computed {tried} load
paths by finite elements. For each of them, the best modulus has a closed form, because forces are proportional to it.

{paragraph(_valley(results))}

**Model.**

- The indenter is a ball of the fitted radius, without friction. The silicone is neo-Hookean with nu = 0.49.
- The rigid grid has collars that reach {collar} into the cells and hold the walls between them. In the model, the walls
  are glued to the tops of the collars, {collar} above the dies and {below:g} mm below the roofs.
- The grid is opaque except for windows of {measured.WINDOW:g} mm. Roofs reflect isotropically and all other surfaces
  absorb, as in the paper. The LED is Lambertian.
- Voltages are compared relative to rest. The circuit is linear up to 3 V of its 3.3 V, so no gain is needed, and no
  reading comes near saturation.

Not modelled are the silicone around the grid below the tops of the collars, friction, gaps beside the collars, light
through the silicone, and compliance of the robot.

{"".join(_pressed(taxel, compared) for taxel, compared in results.taxels.items())}
{paragraph(_stable(results))}

{_spread(results)}

{paragraph(_errors(results))}

### All taxels
![Changes of all taxels while taxel 13 is held](validation/map.png)

{paragraph(_map_words(results))}

While taxel {fitted} is held at {measured.HELD_AT:g} mm, its voltage changes by {hold_change}. The table shows the
changes of all taxels in percent of this change, arranged as on the board. A cell has the measured change / the computed
change (at {MAP_TRAVEL:g} mm) ± one standard deviation, which is explained below:

{markdown_table(heads, _map_rows(results))}

Only the position of the indenter is fitted to this map, namely to the asymmetry of the four nearest taxels: {x} along x
and {y} along y from the middle of taxel {fitted}. All else in the map is predicted.

{_band_words(results)}
"""


def _unknowns(results: PadComparison) -> list[list[str]]:
    height, radius, late = (
        with_error(value, error)
        for value, error in zip([*results.found.unknowns, results.found.late], results.found.deviations, strict=True)
    )
    return [
        ["height of the silicone above the dies", f"{height} mm"],
        ["radius of the end of the indenter", f"{radius} mm"],
        ["Young's modulus", f"{results.found.modulus:.3g} MPa"],
        ["travel from the first contact to the start of the record", f"{late} mm"],
    ]


def _valley(results: PadComparison) -> str:
    """Sentences about other values of the fitted height and radius that fit nearly as well."""
    best = tuple(results.found.unknowns)
    complete, incomplete = (
        ", ".join(
            f"{height:g} mm with {radius:g} mm ({100 * misfit:.1f} %)"
            for (height, radius), misfit in results.found.tried.items()
            if (height, radius) != best
            and misfit < ALIKE * results.found.misfit
            and ((height, radius) in results.found.incomplete) == ends_early
        )
        for ends_early in (False, True)
    )
    misfit = f"{100 * results.found.misfit:.1f} %"
    text = f"The root mean square of the residuals, relative to the largest values, is {misfit}."
    if complete:
        text += f" Other pairs of height and radius fit nearly as well: {complete}."
    if incomplete:
        text += (
            f" The load paths of other pairs end before the last measured travel: {incomplete}. Their residuals are "
            "those of the travels before, so that they are not compared."
        )
    return f"{text} The data hardly determine height and radius separately." if complete or incomplete else text


def _pressed(taxel: int, compared: TaxelComparison) -> str:
    fitted = taxel == measured.PRESSED
    force_target, change_target = (FORCE_TARGET, CHANGE_TARGET) if fitted else (PREDICTED_TARGET, PREDICTED_TARGET)
    columns = [
        (compared.measured.travel, ".3f"),
        (compared.measured.force, ".2f"),
        (compared.computed.force, ".2f"),
        (compared.force_error, "+.1f"),
        (100 * compared.measured.change, ".2f"),
        (100 * compared.change_at_force, ".2f"),
        (compared.change_error, "+.1f"),
    ]
    rows = np.transpose([[_shown(value, form) for value in values] for values, form in columns]).tolist()
    half = ["measured", "computed", "difference [%]"]
    heads = ["travel [mm]", f"force [N] {half[0]}", *half[1:], f"change [%] {half[0]}", *half[1:]]
    end = f" The computed path ends early: {compared.end}" if compared.end else ""
    verdicts = " ".join(
        [
            _verdict("force", compared.force_error, force_target),
            _verdict("change", compared.change_error, change_target),
        ]
    )
    kind = "fitted" if fitted else "predicted"
    return f"""\
{paragraph(f"**Taxel {taxel}, {kind}.** {verdicts}{end}")}

The table has a row for each travel. It compares forces at equal travel, and changes of the voltage at equal force.
Changes are in percent of the voltage at rest, {measured.PRESSES[taxel].at_rest:g} V. Differences are in percent of the
largest measured value:

{markdown_table(heads, rows)}

"""


def _stable(results: PadComparison) -> str:
    """Sentence about the ends of the load paths."""
    ended = [taxel for taxel, compared in results.taxels.items() if compared.end]
    deepest = {taxel: compared.along.travel[-1] + results.found.late for taxel, compared in results.taxels.items()}
    reached = ", ".join(f"{travel:.2f} mm (taxel {taxel})" for taxel, travel in deepest.items())
    if ended:
        return f"Computed paths reach a travel of {reached} from the first contact; why they end is said above."
    return (
        f"The pad has stable states up to the largest computed travels, {reached} from the first contact: neither "
        "buckling nor the way in which its walls are held limits these paths."
    )


def _spread(results: PadComparison) -> str:
    """Sentences about how much the changes of the taxels differ at a force that all taxels reach."""
    at = min(
        compared.measured.force[np.isfinite(compared.change_at_force)].max() for compared in results.taxels.values()
    )
    changes = np.array(
        [
            (
                np.interp(at, compared.measured.force, compared.measured.change),
                np.interp(at, compared.along.force, compared.along.change),
            )
            for compared in results.taxels.values()
        ]
    ).T
    at_rest = np.array([measured.PRESSES[taxel].at_rest for taxel in results.taxels])
    volts = changes * [at_rest, np.full(len(at_rest), measured.PRESSES[measured.PRESSED].at_rest)]
    rows = []
    for label, (bench, model), digits in (("relative to rest [%]", 100 * changes, 1), ("in volts [V]", volts, 3)):
        for words, values in ((f"measured, {label}", bench), (f"computed, {label}", model)):
            rows.append([words, *(f"{value:.{digits}f}" for value in values)])
        rows.append([f"deviation, {label.split(' [')[0]} [%]", *(f"{100 * value:+.0f}" for value in model / bench - 1)])
    model_words = (
        "In the model, all parts and their positions in the cells are equal. The indenter is above the middle of each "
        f"predicted taxel, because its true position is not known. The voltage at rest of taxel {measured.PRESSED} is "
        "used for all computed volts."
    )
    return "\n\n".join(
        [
            paragraph(
                f"**Differences between taxels.** The table compares the taxels at {at:.2f} N, a force that all reach. "
                "It shows the change of the voltage in two ways:"
            ),
            markdown_table(["change", *(f"taxel {number}" for number in results.taxels)], rows),
            paragraph(model_words),
            paragraph(_light_at_rest(changes, volts)),
        ]
    )


def _light_at_rest(changes: np.ndarray, volts: np.ndarray) -> str:
    """Sentences about light that reaches the phototransistors at rest. The arguments are measured and computed changes
    (2, taxels): relative to rest, and in volts."""
    relative_error, volt_error = (float(np.abs(values[1] / values[0] - 1).max()) for values in (changes, volts))
    if volt_error >= relative_error:
        return (
            "Light at rest does not explain the deviations: the changes in volts deviate no less than those relative "
            "to rest."
        )
    return (
        "The taxels may differ in a part of their light at rest that the load does not change. The model has no such "
        "light, because only roofs reflect. This explanation fits because changes in volts deviate less than changes "
        "relative to rest; a part with another gain would change both by the same factor. Three taxels do not prove it."
    )


def _verdict(label: str, error: np.ndarray, target: float) -> str:
    worst = float(error[np.nanargmax(np.abs(error))])
    within = "within" if abs(worst) <= target else "**not within**"
    reached = np.isfinite(error).sum()
    note = "" if reached == len(error) else f", at the {reached} of {len(error)} points that the path reaches"
    return f"The largest difference of the {label} is {worst:+.1f} %{note}, {within} the target of {target:g} %."


def _shown(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "-"


def _errors(results: PadComparison) -> str:
    """Sentences about numerical errors of the fitted path."""
    state = results.errors.isel(travel=-1)
    force = 100 * float(state.force_error / state.force)
    shares = (100 * np.abs(state.change_error / state.change)).values.reshape(bench_pad.SIDE, bench_pad.SIDE)
    middle, nearby = shares[bench_pad.SIDE // 2, bench_pad.SIDE // 2], ring(shares, 1)
    text = (
        f"**Numerical errors.** While taxel {measured.PRESSED} is held, the stated errors of the computation are "
        f"{force:.1f} % of the force, {middle:.1f} % of the change of its voltage, and {nearby:.1f} % of the changes "
        "of its neighbours. They come from a second mesh and the noise of the light."
    )
    finer = results.finer.isel(travel=-1)
    rise = 100 * float(finer.force / state.force - 1)
    change = 100 * float((finer.change / state.change).sel(taxel=measured.PRESSED) - 1)
    return (
        f"{text} On elements of {FINER:g} mm instead of {bench_pad.MESH_SIZE:g} mm, the force differs by "
        f"{rise:+.1f} % and the change by {change:+.1f} %. The fitted height compensates errors that are proportional "
        "to the change."
    )


def _map_rows(results: PadComparison) -> list[list[str]]:
    rows = zip(measured.HELD_MAP, results.moved, band(results).deviation, strict=True)
    return [
        [f"row {number}", *(f"{a} / {round(b)} ± {c:.1f}" for a, b, c in zip(*row, strict=True))]
        for number, row in enumerate(rows, start=1)
    ]


def _map_words(results: PadComparison) -> str:
    difference = results.moved - np.array(measured.HELD_MAP)
    middle = bench_pad.SIDE // 2
    neighbours = np.abs(difference[middle - 1 : middle + 2, middle - 1 : middle + 2])
    centred = np.abs(results.centred - np.array(measured.HELD_MAP)).max()
    worst = np.unravel_index(int(np.abs(difference).argmax()), difference.shape)
    site = f"row {worst[0] + 1}, column {worst[1] + 1}"
    count = int((np.abs(difference) > MAP_TARGET).sum())
    verdict = (
        f"{count} of {difference.size - 1} taxels differ by more than the target of {MAP_TARGET:g} points"
        if count
        else (f"All are within the target of {MAP_TARGET:g} points")
    )
    return (
        f"{verdict}. The largest difference is {difference[worst]:+.0f} points, in {site}; among the eight neighbours "
        f"it is {neighbours.max():.0f}. Without the offset of the indenter, the largest difference would be "
        f"{centred:.0f}. {_widest(results)}"
    )


def _band_words(results: PadComparison) -> str:
    """Sentences about the part of the map's error that the spread of the taxels' sensitivities explains."""
    limits, difference = band(results), np.abs(results.moved - np.array(measured.HELD_MAP))
    times = difference / np.maximum(limits.deviation, ROUNDING)
    row, column = np.unravel_index(int(times.argmax()), times.shape)
    shares = " / ".join(f"{value:.2f}" for value in limits.own.values())
    beyond_list = [
        f"{ratio:.1f} ({100 * limits.chance(ratio):.0f} %)" for ratio in np.sort(times[difference > MAP_TARGET])
    ]
    beyond = (
        f"The taxels beyond the target deviate by {', '.join(beyond_list)} times the ±. In brackets is the probability "
        "of such a deviation or a larger one, from Student's distribution, because "
        f"{len(limits.own)} taxels determine a spread poorly. "
        if beyond_list
        else ""
    )
    sentences = (
        "**Standard deviation in the map.** It is due to the spread of the taxels: when they are pressed themselves, "
        f"taxels {' / '.join(map(str, limits.own))} change {shares} times as much as computed. So their sensitivities "
        f"differ by {100 * limits.spread:.0f} % (one standard deviation). A number of the map is a ratio of two "
        "taxels, so that its standard deviation is larger by the square root of two. It includes the rounding of the "
        "measured values.",
        "**Is the target realistic?** Even if the model were exact otherwise, "
        f"{limits.expected_beyond(MAP_TARGET):.1f} taxels should deviate by more than {MAP_TARGET:g} points "
        "because of this spread. All taxels would be within "
        f"the target with a probability of only {100 * limits.chance_of_none_beyond(MAP_TARGET):.1f} %.",
        f"{beyond}The largest deviation in units of ± is {times[row, column]:.1f} "
        f"({100 * limits.chance(times[row, column]):.0f} %), of the taxel in row {row + 1}, column {column + 1}, whose "
        "voltage hardly changes.",
    )
    return "\n\n".join(map(paragraph, sentences))


def _widest(results: PadComparison) -> str:
    """Sentences about whether the computed map is too narrow or too wide, compared with the maps of all pads that were
    tried."""
    bench, model = (ring(np.array(values), 1) for values in (measured.HELD_MAP, results.centred))
    height, mean, change = results.widest
    means = f"The mean of the four nearest taxels is {bench:.0f} % measured and {model:.0f} % computed."
    if height == results.found.unknowns[0] or abs(bench - model) <= MAP_TARGET:
        return means
    return (
        f"{means} Of the pads tried, that of {height:g} mm is closest with {mean:.0f} %, but its taxel "
        f"{measured.PRESSED} changes by {100 * change:.1f} % while it is held. These data do not show which "
        f"assumption is wrong."
    )
