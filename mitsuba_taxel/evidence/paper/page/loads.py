"""Sections of the page on the paper: the four cell shapes under normal and tangential load."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.evidence.paper import figures, paper
from mitsuba_taxel.evidence.paper.analysis import PUBLISHED, expected_of_counting, skewness, table_one
from mitsuba_taxel.evidence.paper.comparison import order, pairs_in_order
from mitsuba_taxel.evidence.paper.page.words import NAMES, TANGENTIAL, Found, micro, paragraph, steepest
from mitsuba_taxel.evidence.paper.paper_studies import add_seconds
from mitsuba_taxel.evidence.paper.slopes import Sensitivity
from mitsuba_taxel.pads.parametric.pad import DEFAULT_MESH_SIZE
from mitsuba_taxel.studies import stage_totals


def nominal(studies: Found, pictures: Path) -> str:
    nominal, table = studies["nominal"], table_one(studies["nominal"])
    expected = expected_of_counting(nominal)
    figures.normal_curves({cell: paths["fz"] for cell, paths in nominal.items()}, pictures / "fig9.png")
    figures.tangential_curves(nominal, studies.get("beyond"), pictures / "tangential.png")
    figures.sensitivities(table, expected, pictures / "table1.png")
    head = ["shape", "force", "paper [µW/N]", "here [µW/N]", "here / paper", "mean slope here [µW/N]", "steepest at"]
    rows = []
    for kind, published in PUBLISHED.items():
        for cell in paper.CELLS:
            slope = table[kind][cell]
            ratio = with_error(slope.max_slope / published[cell], slope.max_slope_error / published[cell])
            mean = micro(slope.mean_slope, slope.mean_slope_error)
            location = f"taxel {slope.taxel}, {slope.at:g} N"
            rows.append([cell, kind, f"{1e6 * published[cell]:.3g}", steepest(slope), ratio, mean, location])
    direction = [[cell, *(steepest(table[path][cell]) for path in TANGENTIAL)] for cell in paper.CELLS]
    return f"""\
## Fig. 9 and Table 1: four shapes under load
The shapes of cells are compared with the paper by the order of their sensitivities:

{_orders(table)}

![Power under normal force](paper/fig9.png)

![Change of power under tangential force](paper/tangential.png)

The last figure shows the change of power **under tangential forces**, at a normal force of -8 N, for the corner taxel
at (+x, +y) and for the centre. Solid lines end where the paper's solver stopped. Dashed lines, if there are any,
continue to the largest force that the pad bears.

![Sensitivities](paper/table1.png)

The table has a row for each shape of cell and kind of force. The columns *paper* and *here* have the maximum slope: the
largest slope of the curves of all nine taxels. The last column has the taxel and the force at which the slope is
largest:

{markdown_table(head, rows)}

The curves are cubic polynomials through readings, computed without random numbers, and their derivatives with respect
to the force. The stated error is that of the derivatives (light, mechanics and geometry).

The tangential slope above is the larger of those along x and y. The next table has the maximum slopes of each shape for
all directions of the tangential force:

{markdown_table(["shape", *(f"{NAMES[path]} [µW/N]" for path in TANGENTIAL)], direction)}

{paragraph(_cost(nominal))}
"""


def _orders(table: Mapping[str, Mapping[str, Sensitivity]]) -> str:
    """Sentences that compare the order of the cell shapes by sensitivity with the order in the paper."""
    lines = []
    for kind, published in PUBLISHED.items():
        values = {cell: slope.max_slope for cell, slope in table[kind].items()}
        simulated = order(values, {cell: slope.max_slope_error for cell, slope in table[kind].items()})
        expected = sorted(published, key=lambda cell: -published[cell])
        in_order, pairs = pairs_in_order(values, published)
        lines.append(
            f"- **{kind}**: here {' > '.join(simulated.names)} (probability {simulated.certainty:.3f}, errors taken as "
            f"independent); paper {' > '.join(expected)}. {in_order} of {pairs} pairs of shapes come in the same order."
        )
    return "\n".join(lines)


def _cost(nominal: Mapping[str, Mapping[str, Any]]) -> str:
    """Sentences on the computing time by stage, in s, and on the accuracy of the readings."""
    studies = [study for paths in nominal.values() for study in paths.values()]
    seconds: dict[str, float] = {}
    for study in studies:
        add_seconds(seconds, stage_totals(study))
    wall = sum(float(study.attrs["wall_seconds"]) for study in studies)
    light, total = (
        max(float((study[name] / study.power).max()) for study in studies) for name in ("standard_error", "total_error")
    )
    roofs = max(float(study.roof_error.max()) for study in studies)
    sizes = sorted({float(study.attrs.get("mesh_size", DEFAULT_MESH_SIZE)) for study in studies})
    meshes = f"{sizes[0]:.2f} mm" + (f" to {sizes[-1]:.2f} mm" if len(sizes) > 1 else "")
    count = sum(study.power.size for study in studies)
    shares = ", ".join(f"{stage} {value:.0f} s" for stage, value in seconds.items())
    noise = f", of which the noise of the light is at most {light:.2%}" if light else ""
    return (
        f"**Cost and accuracy.** {count} readings took {wall:.0f} s, summed over their studies. Computing times by "
        f"stage, summed over all processes, are {shares} (load: loading of the scene). The largest total error of a "
        f"reading is {total:.2%}{noise}. The estimated error of the roofs' displacement is at most "
        f"{1e3 * roofs:.1f} µm, on finite elements of {meshes}."
    )


def roofs(studies: Found, pictures: Path) -> str:
    nominal = studies["nominal"]
    figures.diagonal_maps(nominal, studies["roofs"], pictures / "fig10.png")
    rows = []
    for cell in paper.CELLS:
        differences = skewness(nominal[cell]["resultant"])
        rows.append([cell, *(micro(*difference) for difference in differences.values())])
    return f"""\
## Fig. 10: a force along the secondary diagonal
![Roofs and powers](paper/fig10.png)

The maps show how roofs and powers change if {paper.SHOWN_TANGENTIAL_FORCE:g} N along (1, 1) are added to a normal force
of -8 N. Taxels are arranged as on the board.

The table has a row for each shape of cell, and a column for each difference of changes that the paper describes. The
paper finds the largest difference between taxels 3 and 7, a medium one between the sides (taxels 2 and 6 against 4 and
8), and almost none on the main diagonal (taxels 1, 5 and 9):

{markdown_table(["shape", "3 - 7 [µW]", "(2 + 6 - 4 - 8) / 2 [µW]", "largest of 1, 5, 9 from their mean [µW]"], rows)}
"""


def beyond(studies: Found, pictures: Path) -> str:
    rows = []
    for cell in paper.CELLS:
        ends = [float(study[path].max()) for path, study in studies["beyond"][cell].items()]
        rows.append([cell, f"{paper.TANGENTIAL_LIMIT[cell]:g}", *(f"{end:g}" for end in ends)])
    reasons = "\n".join(
        f"- {cell}, {NAMES[path]}: {_shorter(reason)}"
        for cell, paths in studies["beyond"].items()
        for path, study in paths.items()
        for reason in study.attrs["failures"].splitlines()[:1]
    )
    return f"""\
### How far the load paths go
The table has a row for each shape of cell. The first column has the tangential force in N at which the paper's solver
stopped. The other columns have the largest tangential force that the pad bears here, in steps of 1 N. The normal force
is -8 N:

{markdown_table(["shape", "paper", *(NAMES[path] for path in TANGENTIAL)], rows)}

Reasons for the end, at the first step that fails:
{reasons}
"""


def _shorter(text: str) -> str:
    """Shorten the numbers in a text to four digits."""
    return re.sub(r"\d+\.\d{4,}", lambda number: f"{float(number[0]):.4g}", text)
