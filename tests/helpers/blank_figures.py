"""Figures that are drawn and not painted, as painting one takes half a second and more."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch


@contextmanager
def blank_figures() -> Iterator[Callable[..., None]]:
    """Have matplotlib write files that say that they are blank; gives the function that paints."""
    from matplotlib.figure import Figure

    paint = Figure.savefig
    with patch.object(Figure, "savefig", _left_blank):
        yield paint


def _left_blank(figure: Any, file: Any, **options: Any) -> None:
    from PIL import Image

    if not hasattr(file, "write"):
        Path(file).write_bytes(b"blank")
    elif options.get("format") == "png":  # to be read again
        Image.new("RGB", (1, 1)).save(file, "png")
