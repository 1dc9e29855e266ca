"""Images of cameras as OpenEXR files with all their channels, and as PNG files to look at."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.sensing.camera import CameraImage
from mitsuba_taxel.sensing.marker_flow import MarkerFlow
from mitsuba_taxel.sensing.scene.finding import is_file

if TYPE_CHECKING:
    import os

BRIGHTEST = 99.5
"""Percentile of the image that is white in the PNG."""
ABOUT = "about"
"""Attribute of the EXR with everything else, as JSON."""
MARKERS = "markers"
"""Fact of an image with the flow of its markers."""
CHANGES = ("difference", "difference_error")
"""Quantities of each colour that an image may have."""
NO_IMAGE = "is not allowed: an image that `taxel render` or `taxel sweep` wrote is needed."
"""End of the refusal of other files."""


def write_image(image: CameraImage, file: Path, about: Mapping[str, object] = MappingProxyType({})) -> Path:
    """Write an image as OpenEXR and, beside it, as PNG.

    The channels of the EXR are ``R``, ``G`` and ``B``, or ``Y``; ``standard_error.R`` and so on, by the light;
    ``mechanics_error.R`` and so on, by the finite elements; ``depth`` in mm;
    ``coat``, 1 in pixels that show the coat; ``displacement.x``, ``.y`` and ``.z`` of the coat in mm;
    ``contact_pressure`` in MPa, if an indenter touches; and, if requested, ``difference.R`` and so on, the difference
    to the image with unloaded pads, and ``difference_error.R`` and so on, its standard error. In the PNG, pixels above
    the percentile `BRIGHTEST` are white.

    Parameters
    ----------
    image : CameraImage
        The image.
    file : Path
        OpenEXR file, which is replaced if it exists.
    about : Mapping[str, object]
        Further facts for the header of the EXR, which JSON can hold.

    Returns
    -------
    Path
        Path of the PNG.

    Raises
    ------
    InputError
        if a file cannot be written.
    """
    write_exr(image, file, about)
    picture = file.with_suffix(".png")
    write_picture(image, picture, white_level(image))
    return picture


def write_exr(image: CameraImage, file: Path, about: Mapping[str, object] = MappingProxyType({})) -> None:
    """Write an image as OpenEXR, with the channels that `write_image` lists.

    Parameters
    ----------
    image : CameraImage
        The image.
    file : Path
        OpenEXR file, which is replaced if it exists.
    about : Mapping[str, object]
        Further facts for the header, which JSON can hold.
    """
    import OpenEXR

    names = _colours(image)
    channels = {name: image.radiance[..., k] for k, name in enumerate(names)}
    for quantity in ("standard_error", "mechanics_error", *CHANGES):
        values = getattr(image, quantity)
        if values is not None:
            channels |= {f"{quantity}.{name}": values[..., k] for k, name in enumerate(names)}
    channels |= {"depth": image.depth, "coat": image.coat}
    channels |= {f"displacement.{axis}": image.displacement[..., k] for k, axis in enumerate("xyz")}
    if image.contact_pressure is not None:
        channels["contact_pressure"] = image.contact_pressure
    pixels = {name: np.ascontiguousarray(values, dtype=np.float32) for name, values in channels.items()}
    markers = {} if image.markers is None else {MARKERS: image.markers.as_lists()}
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "units": "radiance in units of the lights; depth and displacement in mm; contact pressure in MPa",
        "seed": str(image.seed),
        "samples": str(image.samples),
        "replicates": str(image.replicates),
        ABOUT: json.dumps({"seconds": image.seconds, "notes": image.notes, **markers, **about}),
    }
    with replacing(file) as temporary, OpenEXR.File(header, pixels) as exr:
        exr.write(str(temporary))


def read_image(file: str | os.PathLike[str]) -> tuple[CameraImage, dict[str, Any]]:
    """Read an image that `write_image` has written.

    Parameters
    ----------
    file : str or os.PathLike
        OpenEXR file.

    Returns
    -------
    image : CameraImage
        The image, in single precision. If the file has no ``mechanics_error``, as of an older version, it is NaN.
    about : dict[str, Any]
        The further facts of its header.

    Raises
    ------
    InputError
        if the file cannot be read, or is no image of a camera.
    """
    with _opened(file, separate_channels=True) as (header, exr):
        channels = {name: channel.pixels for name, channel in exr.channels().items()}
        about = json.loads(header[ABOUT])
        names = "RGB" if "R" in channels else "Y"
        changes: dict[str, Any] = {
            quantity: _stacked(channels, f"{quantity}.", names)
            for quantity in CHANGES
            if f"{quantity}.{names[0]}" in channels
        }
        radiance = _stacked(channels, "", names)
        if f"mechanics_error.{names[0]}" in channels:
            mechanics_error = _stacked(channels, "mechanics_error.", names)
        else:  # of an older version
            mechanics_error = np.full_like(radiance, math.nan)
        image = CameraImage(
            radiance=radiance,
            standard_error=_stacked(channels, "standard_error.", names),
            mechanics_error=mechanics_error,
            depth=channels["depth"],
            coat=channels["coat"] > 0,
            displacement=_stacked(channels, "displacement.", "xyz"),
            contact_pressure=channels.get("contact_pressure"),
            samples=int(header["samples"]),
            replicates=int(header["replicates"]),
            seed=int(header["seed"]),
            seconds=float(about.pop("seconds")),
            markers=MarkerFlow.of_lists(about.pop(MARKERS)) if MARKERS in about else None,
            notes=tuple(about.pop("notes", ())),
            **changes,
        )
    return image, about


def read_image_facts(file: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the facts in the header of an image that `write_image` has written, without its pixels.

    Parameters
    ----------
    file : str or os.PathLike
        OpenEXR file.

    Returns
    -------
    dict[str, Any]
        The further facts of its header, ``seconds``, ``notes`` and ``samples``.

    Raises
    ------
    InputError
        if the file cannot be read, or is no image of a camera.
    """
    with _opened(file, header_only=True) as (header, _):
        return {**json.loads(header[ABOUT]), "samples": int(header["samples"])}


@contextmanager
def _opened(file: str | os.PathLike[str], **how: bool) -> Iterator[tuple[dict[str, Any], Any]]:
    """Context manager: open an OpenEXR file for reading, and provide its header and the file. Errors while it is read
    become an `InputError`."""
    import OpenEXR

    if not is_file(Path(file)):  # OpenEXR would print a line of its own
        raise InputError(f"{file} {NO_IMAGE}")
    try:
        with OpenEXR.File(str(file), **how) as exr:
            yield dict(exr.header()), exr
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
        raise InputError(f"{file} {NO_IMAGE}") from error


def white_level(*images: CameraImage) -> float:
    """Radiance that is shown as white in pictures of these images: the largest of their percentiles `BRIGHTEST`.

    Parameters
    ----------
    *images : CameraImage
        The images, at least one.

    Returns
    -------
    float
        The radiance; 1 for black images.
    """
    return max(float(np.percentile(image.radiance, BRIGHTEST)) for image in images) or 1.0


def write_picture(image: CameraImage, file: Path, white: float) -> None:
    """Write an image as PNG, for looking at.

    Parameters
    ----------
    image : CameraImage
        The image.
    file : Path
        PNG file, which is replaced if it exists.
    white : float
        Radiance that is white.
    """
    import mitsuba as mi

    shown = np.ascontiguousarray(np.clip(image.radiance / white, 0.0, 1.0), dtype=np.float32)
    kind = mi.Bitmap.PixelFormat.RGB if shown.shape[-1] == 3 else mi.Bitmap.PixelFormat.Y
    with replacing(file) as temporary:
        mi.Bitmap(shown).convert(kind, mi.Struct.Type.UInt8, srgb_gamma=True).write(str(temporary))


def _stacked(channels: Mapping[str, np.ndarray], prefix: str, names: str) -> np.ndarray:
    """Combine the channels with a prefix, such as ``depth``, to one array (H, W, C)."""
    return np.stack([channels[f"{prefix}{name}"] for name in names], axis=-1)


def _colours(image: CameraImage) -> str:
    """Names of the colour channels of an image: R, G and B, or Y."""
    return "RGB" if image.radiance.shape[-1] == 3 else "Y"
