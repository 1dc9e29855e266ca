"""What a plot of tolerances tells about few exact samples."""

from __future__ import annotations

import numpy as np
import pandas

from mitsuba_taxel.plots.spreads import plot_spreads

SPREAD = pandas.DataFrame(
    {
        "figure": ["rest", "rest"],
        "taxel": [1, 2],
        "nominal": [2.0, 4.0],
        "mean": [2.1, 4.1],
        "sd": [0.2, 0.3],
        "low": [1.8, 3.6],
        "high": [2.4, 4.4],
        "linear_sd": [0.2, 0.3],
    }
)
PARAMETERS = pandas.DataFrame({"parameter": ["z"], "total_rest": [1.0]})


def test_ends_of_the_bars_have_errors_if_few_samples_are_exact():
    few = SPREAD.assign(low_error=[0.1, 0.2], high_error=[0.1, 0.2])
    words, bars = [], []
    for spread in (SPREAD, few):
        figure = plot_spreads(spread, PARAMETERS)
        words.append({text.get_text() for text in figure.legends[0].get_texts()})
        bars.append([bar.lines[2][0].get_segments() for bar in figure.axes[0].containers if hasattr(bar, "has_yerr")])
    assert words[1] - words[0] == {"standard error of these ends"}
    assert len(bars[1]) == len(bars[0]) + 2
    (low, high) = bars[1][:2]
    np.testing.assert_allclose(low[0][:, 1], [-15, -5])
    np.testing.assert_allclose(high[1][:, 1], [5, 15])


def test_shares_may_be_unknown():
    unknown = PARAMETERS.assign(**{name: np.nan for name in PARAMETERS if name.startswith("total_")})
    assert plot_spreads(SPREAD, unknown).axes[1].get_xlim() == (0, 1)
