"""Sections of the page on the paper: readings by counted rays, and whether the sensitivities in Table 1 are noise of
the counts."""

from __future__ import annotations

import math
from pathlib import Path

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.evidence.paper import analog as counting
from mitsuba_taxel.evidence.paper import figures, paper
from mitsuba_taxel.evidence.paper.analysis import (
    PUBLISHED,
    expected_of_counting,
    explanations,
    least,
    readings,
    table_one,
)
from mitsuba_taxel.evidence.paper.page.words import Found, micro, steepest
from mitsuba_taxel.evidence.paper.slopes import curves, sensitivity


def analog(studies: Found, pictures: Path) -> str:
    nominal, counted = studies["nominal"], studies["analog"]
    slopes, drawn, true, rows = {}, {}, {}, []
    for cell, study in counted.items():
        force, power = study.fz.values, study.power.values
        centre = nominal[cell]["fz"].sel(taxel=[5])
        reading = curves(centre, "fz").power(force)
        binomial = counting.binomial(reading, counting.RAYS, counting.REPETITIONS)
        slopes[cell], drawn[cell] = (counting.max_slopes(force, samples) for samples in (power, binomial))
        slope = sensitivity(centre, "fz")
        true[cell] = slope.max_slope
        answer, test = counting.summary(slopes[cell]), counting.counting_test(power, counting.RAYS)
        rows.append(
            [
                cell,
                steepest(slope),
                micro(answer.mean, answer.error),
                f"{1e6 * answer.spread:.0f}",
                f"{answer.mean / least(slope):.3g}",
                f"{1e6 * counting.summary(drawn[cell]).mean:.0f}",
                f"{test.ratio:.3f} (p = {test.p:.2g})",
            ]
        )
    figures.repetitions(slopes, drawn, true, pictures / "analog.png")
    head = [
        "shape",
        "true [µW/N]",
        "mean result [µW/N]",
        "spread [µW/N]",
        "result / true",
        "binomial [µW/N]",
        "scatter",
    ]
    repetitions = next(iter(counted.values())).sizes["replicate"]
    return f"""\
## The paper's own procedure, repeated {repetitions} times
![Maximum slopes by counted rays](paper/analog.png)

The paper traces 20 x 3000 = {paper.RAYS} rays for each reading. Its result is the maximum slope over steps of 0.5 N.
Here, this procedure is repeated for the centre taxel: `analog_tracer` counts {counting.RAYS} rays, the nearest power of
two, at each of the 41 normal forces, with new random rays each time.

The table has a row for each shape of cell. It compares the result of the procedure with the *true* maximum slope, which
is computed without noise. The other columns are:

- *spread*: standard deviation of the results.
- *binomial*: mean result if readings are binomial counts of n rays, each of which arrives with the probability p.
- *scatter*: variance of the readings divided by p (1 - p) / n, and p-value of this ratio.

{markdown_table(head, rows)}

A ray tracer that repeats its random numbers at every step would have less noise.
"""


def hypotheses(studies: Found, pictures: Path) -> str:
    nominal = studies["nominal"]
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
        lines.append(f"- {kind}: the best explanation is the {best}, with a misfit of {fits[best].misfit:.2f}.")
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
                    {c: count.mean for c, count in expected[kind].items()},
                )
            ),
        ]
        for cell in paper.CELLS
    ]
    head = [
        "shape",
        *(f"{kind}: {column}" for kind in PUBLISHED for column in ("paper", "root of reading", "counting")),
    ]
    return f"""\
## Is Table 1 counting noise?
Three explanations of the sensitivities in Table 1 are compared:

{chr(10).join(lines)}

Noise is possible for this reason: a reading p from n = {paper.RAYS} rays has a standard deviation of
sqrt(p (1 - p) / n). The largest slope over many steps of 0.5 N is then mostly noise, and proportional to the square
root of the reading.

The table has a row for each kind of force and explanation. Each explanation has one free common factor. The factor of
the maximum slopes is the power of the source in W, or another scale. The misfit is the typical ratio between Table 1
and the explanation:

{markdown_table(["force", "explanation", "factor", "chi-square / freedom", "misfit"], rows)}

Counting noise with one source and equal steps would give both kinds of force the same factor. The tangential factor is
{with_error(ratio, error)} times the normal factor, as if the steps of the tangential force had been
{paper.FORCE_STEP / ratio:.2g} N.

The next table has a row for each shape of cell, with values relative to the parallelepiped. *Counting* is the mean of
the maximum slope of nine curves, with binomial counts of {paper.RAYS} rays for each reading; the probabilities are the
readings of this program:

{markdown_table(head, ratios)}
"""
