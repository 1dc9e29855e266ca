"""The page on the paper (`paper.md`): tables, figures, and text whose numbers come from the studies of a rerun."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.evidence.paper.page import choices as page_choices
from mitsuba_taxel.evidence.paper.page import experiments as page_experiments
from mitsuba_taxel.evidence.paper.page import loads as page_loads
from mitsuba_taxel.evidence.paper.page import noise as page_noise
from mitsuba_taxel.evidence.paper.page import plate as page_plate
from mitsuba_taxel.evidence.paper.page.mould import write_moulds
from mitsuba_taxel.evidence.paper.page.optima import write_optima
from mitsuba_taxel.evidence.paper.page.words import Found
from mitsuba_taxel.evidence.paper.parts import BY_NAME_ONLY
from mitsuba_taxel.evidence.paper.variations import NOMINAL_SPACING
from mitsuba_taxel.studies.plan.files import make_folder

_HEAD = """\
# The paper, rerun

For readers of the paper, and for those who ask whether the program reproduces it.

Written by `{command}`; do not edit by hand. Every number and every comparison in the text comes from the runs.

*Multiphysics Simulation for the Optimization of an Optoelectronic-Based Tactile Sensor* simulates a pad of 3 x 3 cells
on photo-reflectors with a commercial suite. This page recomputes its figures and tables with `mitsuba_taxel`. Nothing
is fitted to the paper's numbers.

**Unstated.** The paper does not state some properties of its sensor: the position and orientation of LED and
phototransistor in the package, the size of the dark centre of the LED, which of two "conical" emission laws it used,
and Poisson's ratio.

**The nominal sensor** of this page is that of `pad.xml`:

- The dies are {spacing:g} mm apart. The LED is at -x, and the long side of the phototransistor is along x.
- The LED emits 1 W, uniformly per solid angle up to 88 degrees. Its dark centre is 0.1 mm wide. The power scales all
  readings and slopes alike.
- The silicone is neo-Hookean with nu = 0.49.
- Roofs reflect isotropically. All else absorbs.

**Errors** are one standard deviation: the total error for slopes, that of the light alone for readings.
"""

SECTIONS: tuple[tuple[tuple[str, ...], Callable[[Found, Path], str]], ...] = (
    (("fig4", "fig5", "fig6"), page_plate.optics),
    (("peak",), page_plate.peaks),
    (("nominal",), page_loads.nominal),
    (("nominal", "roofs"), page_loads.roofs),
    (("beyond",), page_loads.beyond),
    (("variations",), page_choices.variations),
    (("nominal", "analog"), page_noise.analog),
    (("nominal",), page_noise.hypotheses),
    (("nominal",), page_experiments.experiments),
)
"""Sections of the page, and the parts that each needs."""


def write_pages(studies: Found, docs: Path, command: str) -> list[Path]:
    """Write all pages of which at least one part is complete: ``paper.md``, ``optimum.md`` (best sensors) and
    ``mould.md`` (printed moulds)."""
    pages = [write_page(studies, docs, command)] if set(studies) - {"optimum", *BY_NAME_ONLY} else []
    if "optimum" in studies:
        pages.append(write_optima(studies["optimum"], docs, command))
    if moulds := {wall: paths for name in BY_NAME_ONLY for wall, paths in studies.get(name, {}).items()}:
        pages.append(write_moulds(moulds, docs, f"{command} --only mould"))
    return pages


def write_page(studies: Found, docs: Path, command: str) -> Path:
    """Write ``paper.md`` and, in ``paper/``, the figures of the complete parts; returns the page."""
    pictures = docs / "paper"
    make_folder(pictures)
    sections = [_HEAD.format(command=command, spacing=NOMINAL_SPACING)]
    for needed, section in SECTIONS:
        if all(name in studies for name in needed):
            sections.append(section(studies, pictures))
    page = docs / "paper.md"
    write_text(page, "\n".join(sections))
    return page
