"""The contact sheet of a study of images: small pictures of all of them, with their parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_COLUMNS = 8
WIDTH = 2.4
"""Width of a picture in inches."""


def plot_contact_sheet(images: Mapping[str, np.ndarray], white: float, columns: int | None = None) -> Figure:
    """Draw images side by side, each with its label above.

    Parameters
    ----------
    images : Mapping[str, np.ndarray]
        Radiance (H, W, C) of each image by its label, with one or three channels.
    white : float
        Radiance that is white.
    columns : int, optional
        Number of images in a row, at most `MOST_COLUMNS`; by default such that the sheet is about square.

    Returns
    -------
    Figure
        The contact sheet.
    """
    from matplotlib.figure import Figure

    if columns is None or not 1 <= columns <= MOST_COLUMNS:
        columns = min(math.ceil(math.sqrt(len(images))), MOST_COLUMNS)
    rows = math.ceil(len(images) / columns)
    height, width = next(iter(images.values())).shape[:2]
    figure = Figure(figsize=(columns * WIDTH, rows * (WIDTH * height / width + 0.3)), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel in axes:
        panel.set_axis_off()
    for panel, (label, radiance) in zip(axes, images.items(), strict=False):
        # The transfer curve of sRGB, as in the PNG of each image.
        linear = np.clip(radiance / white, 0.0, 1.0)
        encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        panel.imshow(encoded if encoded.shape[-1] == 3 else encoded[..., 0], cmap="gray", vmin=0.0, vmax=1.0)
        panel.set_title(label, fontsize=8)
    return figure
