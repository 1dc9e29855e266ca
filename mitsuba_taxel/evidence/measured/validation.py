"""The page `validation.md`, which compares simulated with measured sensors and lists disagreements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.characterise.characteristics import NOT_RESOLVED
from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.evidence.measured import measured, memory_fit, validation_figures
from mitsuba_taxel.evidence.measured.bench_pad_in_time import Prony
from mitsuba_taxel.evidence.measured.cycles import PER_FORCE, circuit_at_rest, cycle, figures
from mitsuba_taxel.evidence.measured.dead_weights import weights
from mitsuba_taxel.evidence.measured.held_maps import HeldMapComparison, held_map
from mitsuba_taxel.evidence.measured.pad_assumptions import tried
from mitsuba_taxel.evidence.measured.pad_comparison import PadComparison, predicted_path, pressed_at, results
from mitsuba_taxel.evidence.measured.page.assumptions import assumptions_section
from mitsuba_taxel.evidence.measured.page.dead_weights import weights_section
from mitsuba_taxel.evidence.measured.page.held_maps import maps_section
from mitsuba_taxel.evidence.measured.page.memory import memory_section
from mitsuba_taxel.evidence.measured.page.pad import pad_section
from mitsuba_taxel.evidence.measured.page.rest import rest_section
from mitsuba_taxel.evidence.measured.page.softening import softening_section
from mitsuba_taxel.evidence.measured.part_curves import EDGE_WIDTH
from mitsuba_taxel.evidence.measured.rest_spread import spread
from mitsuba_taxel.evidence.measured.sideways import FORCES, largest_slope, pushed
from mitsuba_taxel.evidence.measured.softening import first_loading, paper_loading
from mitsuba_taxel.evidence.measured.taxel_spread import own_sensitivity
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.page.words import paragraph
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.parts import edge_positions, mirror_curve, read_part
from mitsuba_taxel.studies.plan.files import make_folder

EDGE_HEIGHT = 1.0
MINUTES = 80
"""CPU time of the command, rounded up."""
_FINE = np.linspace(0.25, 6.5, 626)

_HEAD = """\
# Comparison with measured sensors

For users who ask how well the program predicts measured sensors.

Written by `{command}`; do not edit by hand. Values called *fitted* come from the measurement itself; all others are
predicted. The numbers of the measurements are in `mitsuba_taxel/evidence/measured/measured.py` and in the part's file.
With an empty DIR the command takes about {minutes} minutes of one core; results that are in DIR already are not
computed again.
"""


def write_validation(store: PaperStudies, docs: Path, command: str) -> Path:
    """Compute missing studies, and write ``validation.md`` and the figures in ``validation/``; returns the path of the
    page."""
    pictures = docs / "validation"
    make_folder(pictures)
    fitted = results(store)
    memory = memory_fit.results(store, fitted.fitted, fitted.found.late)
    sections = [
        _HEAD.format(command=command, minutes=MINUTES),
        pad_section(fitted, pictures),
        maps_section(
            [_held(store, fitted, taxel) for taxel in measured.HELD_PRESSES],
            {taxel: own_sensitivity(compared) for taxel, compared in fitted.taxels.items()},
        ),
        assumptions_section(fitted, tried(store, fitted)),
        memory_section(memory, pictures),
        softening_section(
            {taxel: first_loading(store, fitted.fitted, fitted.found.late, taxel) for taxel in measured.PRESSES},
            paper_loading(store),
            memory,
        ),
        weights_section(
            weights(store, fitted.fitted.height, round(fitted.found.modulus, 3)),
            {taxel: own_sensitivity(compared) for taxel, compared in fitted.taxels.items()},
        ),
        rest_section(spread(store)),
        _vcnt2020(pictures),
        _tables(store, memory.terms, pictures),
    ]
    page = docs / "validation.md"
    write_text(page, "\n".join(sections))
    return page


def _held(store: PaperStudies, fitted: PadComparison, taxel: int) -> HeldMapComparison:
    """Map of a held taxel, with the indenter at the place that agrees best with the measured map."""
    path = predicted_path(store, fitted.fitted, taxel)
    return held_map(fitted.found, taxel, path, partial(pressed_at, store, fitted.fitted, taxel))


def _vcnt2020(pictures: Path) -> str:
    reflector = read_part("vcnt2020")
    heights, sheet = np.array(reflector.distance_curve).T
    curve = mirror_curve(reflector, _FINE)
    model, curve = mirror_curve(reflector, heights) / curve.max(), curve / curve.max()
    validation_figures.mirror(heights, sheet, _FINE, curve, pictures / "vcnt2020.png")
    rows = [
        [f"{z:g}", f"{100 * a:.1f}", f"{100 * b:.1f}", f"{100 * (b - a):+.1f}"]
        for z, a, b in zip(heights, sheet, model, strict=True)
    ]
    deficit = 100 * (1 - model[-3:] / sheet[-3:]).mean()
    worst = int(np.abs(model - sheet).argmax())
    edges = [
        [word, *(f"{position:.3f}" for position in edge_positions(reflector, EDGE_HEIGHT, k))]
        for k, word in enumerate("xy")
    ]
    return f"""\
## VCNT2020 under a mirror
![Current against the height of the mirror](validation/vcnt2020.png)

The largest difference between the computed and the measured current is {100 * (model - sheet)[worst]:+.1f} % of the
peak, at {heights[worst]:g} mm. Beyond 4 mm the computed current is too {"low" if deficit > 0 else "high"} by
{abs(deficit):.0f} %.

**Fitted:** the size of the dies and their depth under the windows, to the distance curve of the datasheet.
The table has a row for each height of the mirror. It shows the current in percent of its maximum:

{markdown_table(["height [mm]", "datasheet", "computed", "difference"], rows)}

**Predicted:** where the edge of a mirror is when it passes over the part (`taxel parts vcnt2020 --edges
{EDGE_HEIGHT:g}`). The mirror is at a height of {EDGE_HEIGHT:g} mm. The table has a row for each direction of the
motion. It shows the position of the edge, from the centre of the body, at 10, 50 and 90 % of the current:

{markdown_table(["along", "10 % [mm]", "50 % [mm]", "90 % [mm]"], edges)}

{paragraph(_edge_words(edges[0]))}
"""


def _edge_words(along_x: Sequence[str]) -> str:
    """Sentences that compare the width of the edge along x with the datasheet."""
    width = float(along_x[3]) - float(along_x[1])
    return (
        f"Along x, the datasheet has a width of {EDGE_WIDTH:g} mm from 10 to 90 % of the current; this part has "
        f"{width:.3f} mm. Surfaces about twice as wide as its dies give both curves of the datasheet to 3.1 % ([curves "
        "of parts](part_curves.md#the-emitting-and-receiving-surfaces-of-a-vcnt2020)), which also has the prediction "
        "along y."
    )


def _tables(store: PaperStudies, terms: Prony, pictures: Path) -> str:
    cycles = {cell: cycle(store, cell, terms) for cell in paper.MEASURED_NORMAL}
    cell_figures = {cell: figures(study) for cell, study in cycles.items()}
    ranges = {
        cell: (ranges_measured, (cell_figures[cell].least, cell_figures[cell].most))
        for cell, ranges_measured in paper.MEASURED_NORMAL.items()
    }
    validation_figures.sensitivities(ranges, pictures / "sensitivities.png")
    rows = []
    for cell, simulated in cell_figures.items():
        low, high = paper.MEASURED_NORMAL[cell]
        rows.append(
            [
                cell,
                f"{1e3 * low:.2f} to {1e3 * high:.2f}",
                f"{1e3 * simulated.least:.2f} to {1e3 * simulated.most:.2f}",
                f"{paper.MEASURED_NONLINEARITY[cell]:g}",
                _resolved(*simulated.nonlinearity),
                f"{measured.MEASURED_HYSTERESIS[cell]:g}",
                _resolved(*simulated.hysteresis),
            ]
        )
    heads = ["shape", "mV/N measured", "computed", "e_nl [%] measured", "computed", "e_h [%] measured", "computed"]
    electronics = f"{measured.LOAD_RESISTANCE / 1e3:g} kOhm, {measured.ADC_BITS} bit at {measured.ADC_REFERENCE:g} V"
    sideways_heads = ["shape", "along x: mV/N measured", "computed", "along y: mV/N measured", "computed"]
    flat = cell_figures["parallelepiped"]
    shares = ", ".join(
        f"{100 * cell_figures[cell].most / max(ranges_measured):.0f} %"
        for cell, ranges_measured in paper.MEASURED_NORMAL.items()
    )
    hysteresis = f"{100 * flat.hysteresis[0] / measured.MEASURED_HYSTERESIS['parallelepiped']:.0f}"
    return f"""\
## The paper's Tables 2 to 4 in volts, and its hysteresis
![Sensitivities of the taxels of three shapes](validation/sensitivities.png)

*From the least to the most sensitive taxel of a pad.*

The most sensitive taxels reach {shares} of the measured sensitivities (flat, spherical and hemispheric cells).
The viscoelastic loop of the parallelepiped is {hysteresis} % as wide as the measured one. Nothing is fitted to the
paper's tables.

### Normal forces
The table has a row for each shape of cell. A range of sensitivities (mV/N) is from the least to the most sensitive
taxel; a sensitivity is a mean slope from 0 to 10 N. e_nl is the nonlinearity and e_h the hysteresis:

{markdown_table(heads, rows)}

A ratio is not resolved where readings change by little more than their error: under 10 N, the reading of a hemispheric
cell falls and rises again. Its bound is two standard errors above the computed value.

The computed values are results of loading cycles:

- The pad is the nominal pad of nine cells. The force per cell (10 N on 12 cells) and the rate are those of the
  experiments.
- The electronics are those of the pad above ({electronics}). The power of the LEDs is such that the mean
  voltage at rest is the same, {measured.REST_VOLTAGE:g} V.
- The Prony series is that fitted above, possibly of another silicone. The paper's modulus is the long-term modulus.

Not modelled are the tolerances of boards and moulds ([tolerances](tutorials/tolerances.md)), and the steps of printed
moulds. The authors attribute the nonlinearity of round cells to these steps; [printed moulds](mould.md) has them, one
factor at a time.

### Tangential forces
The table compares with Table 3 of the paper. It has a row for each shape of cell, and the sensitivities to forces along
x and y, at a normal force of 10 N on 12 cells. The computed value is that of the most sensitive taxel; the experiments
used the taxel with the largest sensitivity to normal forces:

{markdown_table(sideways_heads, _sideways(store, cycles))}

The circuit is that of the first table. The pads are elastic, with the paper's modulus. Tangential forces are computed
up to {FORCES[-1] / PER_FORCE:g} N on 12 cells, because the paper does not state their range.
"""


def _sideways(store: PaperStudies, cycles: Mapping[str, xr.Dataset]) -> list[list[str]]:
    """Rows of the comparison with Table 3 of the paper (sensitivity under tangential forces), computed with the
    circuits of the loading cycles."""
    rows = []
    for cell, slopes in paper.MEASURED_TANGENTIAL.items():
        row, circuit = [cell], circuit_at_rest(cycles[cell])
        for along, slope in zip(("fx", "fy"), slopes, strict=True):
            simulated = (1e3 * value for value in largest_slope(pushed(store, cell, along), circuit))
            row += [f"{1e3 * slope:.2f}", _resolved(*simulated)]
        rows.append(row)
    return rows


def _resolved(value: float, error: float) -> str:
    """A figure with its error, or a bound of twice its error above it where it is not larger than its error."""
    if value > error:
        return with_error(value, error)
    bound = value + 2 * error
    return f"{NOT_RESOLVED}, below {bound:.2g}" if np.isfinite(bound) else NOT_RESOLVED
