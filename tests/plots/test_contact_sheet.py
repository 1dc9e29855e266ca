"""The contact sheet of a study of images."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.plots.contact_sheet import plot_contact_sheet


@pytest.mark.parametrize(("count", "columns", "rows"), [(3, None, 2), (6, 3, 2), (10, None, 3), (9, 20, 3)])
def test_images_lie_side_by_side_under_their_labels(count, columns, rows):
    images = {f"x={number}": np.full((6, 8, 3), number / count) for number in range(count)}
    figure = plot_contact_sheet(images, 1.0, columns)
    panels = [panel for panel in figure.axes if panel.images]
    assert [panel.get_title() for panel in panels] == list(images)
    assert len({panel.get_subplotspec().rowspan.start for panel in panels}) == rows


def test_linear_light_is_drawn_with_the_curve_of_srgb():
    # Half of the light is 188 of 255 (IEC 61966-2-1), above white is white.
    (panel,) = plot_contact_sheet({"a": np.array([[[0.25], [1.0]]])}, 0.5).axes
    assert np.round(255 * panel.images[0].get_array()).tolist() == [[188, 255]]
