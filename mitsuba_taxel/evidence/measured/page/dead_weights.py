"""A section of the page of measured sensors: dead weights on the whole pad, a prediction."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.evidence.measured import measured
from mitsuba_taxel.evidence.measured.dead_weights import slopes
from mitsuba_taxel.evidence.paper.page.words import paragraph

_HEADS = ("weight [N]", "off the middle [mm]", "mean slope [mV/N]", "least to largest", "sinking [mm]", "tilt [°]")
EARLIER = (
    "The first one, with a fit of 8.05 mm and 1.17 mm to the same record, was 17.95 mV/N at 1.2 N, 18.03 mV/N at "
    "2.4 N, and 18.14 ± 1.91 mV/N and 0.150 ± 0.008° for 2.4 N that stand 3.5 mm off the middle. The present fit "
    "leaves out load paths that end before the last measured travel."
)
"""An earlier version of the prediction: a prediction that changes says so."""


def weights_section(study: xr.Dataset, own: Mapping[int, float]) -> str:
    """The section of the page of measured sensors on dead weights, from the states of :func:`weights`. ``own`` is the
    measured sensitivity of pressed taxels relative to the computed one, by their number.
    """
    slope, error = (1e3 * values for values in slopes(study))
    largest = int(np.argmax(np.hypot(study.x, study.y).values))

    def shown(value: float, uncertainty: float, digits: int) -> str:
        plus = f" ± {uncertainty:.{digits}f}" if np.isfinite(uncertainty) else ""
        return f"{value:.{digits}f}{plus}"

    rows = [
        [
            f"{float(study.force[k]):g}",
            f"{float(np.hypot(study.x[k], study.y[k])):g}",
            # Errors of taxels by the elements have a common cause: their mean is that of the mean.
            shown(slope[k].mean(), error[k].mean(), 2),
            f"{slope[k].min():.2f} to {slope[k].max():.2f}",
            shown(float(study.sinking[k]), float(study.sinking_error[k]), 4),
            shown(float(study.tilt[k]), float(study.tilt_error[k]), 3),
        ]
        for k in range(study.sizes["place"])
    ]
    moment = float(study.force[largest] * np.hypot(study.x, study.y)[largest])
    per_moment = float(study.tilt[largest]) / moment
    answer = (
        f"The mean slope of the voltages is about {slope.mean():.0f} mV/N, wherever the weight stands. A weight of "
        f"{float(study.force[largest]):g} N that stands {float(np.hypot(study.x, study.y)[largest]):g} mm off the "
        f"middle tilts the plate by {float(study.tilt[largest]):.2f}°. This prediction was written before any "
        f"comparison with a measurement. {EARLIER}"
    )
    words = (
        f"The tilt is proportional to the moment: {1e3 * per_moment:.1f} thousandths of a degree per N mm. A weight of "
        f"2.4 N that stands 3 to 4 mm off the middle tilts the plate by {2.4 * 3 * per_moment:.2f} to "
        f"{2.4 * 4 * per_moment:.2f}°, and a weight of 0.35 N by {0.35 * 3 * per_moment:.3f} to "
        f"{0.35 * 4 * per_moment:.3f}°."
    )
    errors = (
        "**Errors** (±) are those of finite elements and light. They do not contain the assumptions: the plate is "
        "bonded to the whole top, the silicone and its height are those fitted to taxel 13, and all taxels have the "
        f"sensitivity of that taxel. When they are pressed themselves, taxels {' / '.join(map(str, own))} change "
        f"{' / '.join(f'{ratio:.2f}' for ratio in own.values())} times as much as computed."
    )
    return f"""\
## Dead weights on the whole pad: a prediction
{paragraph(answer)}

Weights of 0.35 to 2.4 N stand on a rigid plate. The plate is bonded to the whole top of the pad and tilts freely
(`load="plate_wrench"`). Height and modulus of the silicone are those fitted to taxel 13; nothing else is fitted. All 25
taxels have the mean voltage at rest, {measured.REST_VOLTAGE:g} V.

The table has a row for each weight and its place. A slope is the change of a taxel's voltage from rest, divided by the
weight; the third column has the mean over all taxels, the fourth their range. *Sinking* is the downward displacement of
the plate:

{markdown_table(_HEADS, rows)}

{paragraph(words)}

{paragraph(errors)}
"""
