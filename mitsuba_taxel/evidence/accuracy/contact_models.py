"""Speed of contact models in all their forms, and their error against Hertz's theory, on a half-space."""

from __future__ import annotations

import runpy
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import numpy as np

from mitsuba_taxel.surrogates import ContactModel, write_contact_model

SIDE, HEIGHT, MODULUS = 11.65, 4.55, 0.4
"""Sides and height in mm of a pad of 3 x 3 cells, and a plane-strain modulus in MPa."""
PITCH, REST, WIDTH = 3.55, 4e-3, 1.3
"""Distance of taxels in mm; their reading at rest in W, and the width in mm of the response to forces."""
RADII, DEPTHS, PLACES = (2.0, 6.0), (0.05, 0.4), 0.3
"""Ranges of the radii and depths of balls in mm, and of their places relative to the side of the pad."""


@dataclass(frozen=True)
class ContactSpeedRow:
    """Cost and error of one form of a contact model.

    Attributes
    ----------
    case : str
        Numbers of patches and taxels, in words.
    form : str
        Form of the model.
    seconds : float
        CPU seconds for all pads, after the first call.
    difference : float
        Largest difference of a force from that of the model itself, relative to the largest force.
    hertz : float
        Root mean square difference of the forces from Hertz's theory, relative to the largest force.
    """

    COLUMNS: ClassVar = {
        "case": ("patches, taxels", ""),
        "form": ("form", ""),
        "seconds": ("CPU s", ".2f"),
        "difference": ("from the model", ".1e"),
        "hertz": ("from Hertz", ".2%"),
    }
    case: str
    form: str
    seconds: float
    difference: float
    hertz: float


def half_space_model(patches: int) -> ContactModel:
    """A contact model of a half-space, with nine made-up taxels.

    Displacements under uniform pressures on rectangles are those of A. E. H. Love, Phil. Trans. R. Soc. A 228 (1929).

    Parameters
    ----------
    patches : int
        Number of patches along each side.

    Returns
    -------
    ContactModel
        The model.
    """
    side = SIDE / patches
    along = side * (np.arange(patches) - (patches - 1) / 2)
    x, y = (coordinate.ravel() for coordinate in np.meshgrid(along, along[::-1]))
    a, b = x[:, None] - x, y[:, None] - y

    def corner(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return u * np.arcsinh(v / np.abs(u)) + v * np.arcsinh(u / np.abs(v))

    half = side / 2
    love = corner(a + half, b + half) - corner(a - half, b + half) - corner(a + half, b - half)
    love += corner(a - half, b - half)
    taxels = PITCH * np.array([[column, -row] for row in (-1, 0, 1) for column in (-1, 0, 1)])
    squares = (x - taxels[:, :1]) ** 2 + (y - taxels[:, 1:]) ** 2
    limits = 0.5 * SIDE * np.array([[-1.0, -1.0], [1.0, 1.0]])
    return ContactModel(
        x=along,
        y=along[::-1],
        size=(side, side),
        height=HEIGHT,
        covered=np.ones((patches, patches), dtype=bool),
        compliance=love / (np.pi * side**2 * MODULUS),
        rest=np.full(9, REST),
        gradient=REST * np.exp(-squares / (2 * WIDTH**2)),
        largest_depth=DEPTHS[1],
        places=limits,
    )


def contact_speed(patches: list[int], pads: int) -> Iterator[ContactSpeedRow]:
    """Measure a contact model in the forms whose libraries are installed.

    Parameters
    ----------
    patches : list[int]
        Numbers of patches along each side.
    pads : int
        Number of pads in one call.

    Yields
    ------
    ContactSpeedRow
        A row for each form.
    """
    rng = np.random.default_rng(0)
    radius, depth = rng.uniform(*RADII, pads), rng.uniform(*DEPTHS, pads)
    places = SIDE * rng.uniform(-PLACES, PLACES, (2, pads))
    hertz = 4 / 3 * MODULUS * np.sqrt(radius) * depth**1.5
    for count in patches:
        model = half_space_model(count)
        squares = (model.points[..., 0] - places[0, :, None, None]) ** 2
        squares += (model.points[..., 1] - places[1, :, None, None]) ** 2
        # Hertz's theory is that of paraboloids.
        maps = depth[:, None, None] - squares / (2 * radius[:, None, None])
        own = None
        with TemporaryDirectory() as folder:
            for form, run in _forms(model, Path(folder)):
                run(maps)
                start = time.process_time()
                force = -np.asarray(run(maps))[:, 2]
                seconds = time.process_time() - start
                own = force if own is None else own
                yield ContactSpeedRow(
                    f"{count} x {count}, 9",
                    form,
                    seconds,
                    float(np.abs(force - own).max() / own.max()),
                    float(np.sqrt(np.square(force - hertz).mean()) / hertz.max()),
                )


def _forms(model: ContactModel, folder: Path) -> Iterator[tuple[str, Callable[[np.ndarray], Any]]]:
    """Names of the forms, and functions from maps to forces (B, 3)."""
    yield "numpy", lambda maps: model(maps).force
    if find_spec("onnx") and find_spec("onnxruntime"):
        import onnxruntime

        write_contact_model(model, folder / "pad.onnx")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        session = onnxruntime.InferenceSession(
            (folder / "pad.onnx").read_bytes(), options, providers=["CPUExecutionProvider"]
        )
        yield "ONNX", lambda maps: session.run(["force", "power"], {"depth": maps})[0]
    if find_spec("jax"):
        import jax

        write_contact_model(model, folder / "pad.py")
        read = jax.jit(runpy.run_path(str(folder / "pad.py"))["read"])
        double = jax.numpy.zeros(0, dtype=float).dtype == np.float64
        yield f"JAX, {'double' if double else 'single'}", lambda maps: read(maps).force
