"""A picture of a sensor: the sectioned pad, its photo-reflectors and the board, in soft light.

The picture is rendered from a separate scene of Mitsuba's plugins in an RGB variant. Mitsuba's parser loads this scene
for a variant given by name, so that the active variant does not change.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.arguments import check_whole
from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.geometry.surfaces.triangles import area_normals, components, neighbours, unit
from mitsuba_taxel.report.picture.sensor_parts import ShownPart

VARIANT = "llvm_ad_rgb"
PICTURES = (".png", ".exr")
ASPECT = 1.6
NARROWEST, WIDEST = 16, 8192
MOST_SAMPLES = 65536
PER_PASS = 16
"""Samples per pixel and pass, stratified and hence a square number; progress is reported after each pass."""

AZIMUTH, ELEVATION, FIELD_OF_VIEW = 24.0, 19.0, 16.0
"""Camera, in degrees: azimuth to the right of -y, elevation above the board, and horizontal field of view."""
MARGIN = 1.1
CREASE = 25.0
"""Edges are shown sharp from this angle between two triangles, in degrees."""
GLOW = (18.0, 0.30, 0.05)
"""Radiance of the LEDs' faces, relative to the sky with about 1; near infrared is shown as red."""
SKY, LAMP = (0.96, 0.98, 1.0), (5.2, 5.05, 4.8)
"""Radiances with which the unshaded ground is slightly overexposed white."""

SEEN = 0.35
"""Opacity of an indenter, through which the pressed surface is visible."""


def _matt(*colour: float) -> dict[str, Any]:
    return _twosided({"type": "diffuse", "reflectance": _rgb(colour)})


def _glossy(*colour: float, roughness: float) -> dict[str, Any]:
    return _twosided({"type": "roughplastic", "diffuse_reflectance": _rgb(colour), "alpha": roughness})


def _twosided(bsdf: dict[str, Any]) -> dict[str, Any]:
    return {"type": "twosided", "bsdf": bsdf}


def _rgb(colour: Sequence[float]) -> dict[str, Any]:
    return {"type": "rgb", "value": list(colour)}


_SHELL = (0.13, 0.20, 0.29)
_OUTSIDE = _matt(*_SHELL)
MATERIALS: dict[str, dict[str, Any]] = {
    "roof": _matt(0.80, 0.80, 0.78),
    "side": _matt(0.16, 0.17, 0.19),
    "bottom": _OUTSIDE,
    "top": _OUTSIDE,
    "outer": _OUTSIDE,
    "cut": _matt(0.44, 0.52, 0.58),
    "body": _glossy(0.02, 0.02, 0.022, roughness=0.2),
    "led": _matt(0.8, 0.2, 0.1),
    "phototransistor": _glossy(0.01, 0.17, 0.12, roughness=0.1),
    "board": _glossy(0.03, 0.11, 0.065, roughness=0.3),
    "plate": _glossy(0.45, 0.46, 0.48, roughness=0.15),
    "indenter": {"type": "mask", "opacity": SEEN, "bsdf": _matt(0.55, 0.42, 0.25)},
}
"""Appearance of the materials of `ShownPart`."""
_COLOURED = _twosided({"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "vertex_color"}})
_PROPERTIES = ("x", "y", "z", "nx", "ny", "nz", "r", "g", "b")


def write_picture(pixels: np.ndarray, file: Path) -> None:
    """Write a picture, as OpenEXR with linear colours or as PNG with the sRGB transfer curve.

    Parameters
    ----------
    pixels : (H, W, 3) ndarray
        Linear colours.
    file : Path
        File whose suffix determines the format.

    Raises
    ------
    WriteError
        if the file cannot be written.
    """
    numbers = np.ascontiguousarray(pixels, dtype=np.float32)
    if file.suffix.lower() == ".png":
        import mitsuba as mi

        bitmap = mi.Bitmap(numbers).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, srgb_gamma=True)
        with replacing(file) as temporary:
            bitmap.write(str(temporary))
        return
    import OpenEXR  # Mitsuba's writer deadlocks if Dr.Jit has one thread

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with replacing(file) as temporary, OpenEXR.File(header, {"RGB": numbers}) as image:
        image.write(str(temporary))


def with_scale(pixels: np.ndarray, most: float) -> np.ndarray:
    """Draw a colour scale for contact pressures up to ``most`` MPa into the upper left corner of a picture.

    Parameters
    ----------
    pixels : (H, W, 3) ndarray
        Linear colours.
    most : float
        Largest pressure, in MPa.

    Returns
    -------
    (H, W, 3) ndarray
        A copy.
    """
    size = _letter(pixels)
    pixels = labelled(pixels, f"contact pressure, 0 to {most:.2g} MPa", (size, size))
    bar = pixels[5 * size // 2 : 3 * size, size : 13 * size]
    bar[:] = _linear_colours(np.linspace(0, most, bar.shape[1]), most)
    return pixels


def labelled(pixels: np.ndarray, words: str, position: tuple[int, int] | None = None) -> np.ndarray:
    """Draw a line of text into the lower left corner of a picture, or at a position.

    Parameters
    ----------
    pixels : (H, W, 3) ndarray
        Linear colours.
    words : str
        One line of text.
    position : tuple[int, int], optional
        Position in pixels from the left and the top; by default in the lower left corner.

    Returns
    -------
    (H, W, 3) ndarray
        A copy.
    """
    from PIL import Image, ImageDraw, ImageFont

    height, width = pixels.shape[:2]
    mask = Image.new("L", (width, height))
    size = _letter(pixels)
    ImageDraw.Draw(mask).text(position or (size, height - 2 * size), words, fill=255, font=ImageFont.load_default(size))
    ink = np.asarray(mask, dtype=float)[..., None] / 255
    return pixels * (1 - ink) + 0.01 * ink


def _letter(pixels: np.ndarray) -> int:
    """Height in pixels of the letters in a picture, which depends on the size of the picture."""
    return max(len(pixels) // 24, 9)


@in_turn
def render_parts(
    parts: Sequence[ShownPart],
    *,
    width: int = 1600,
    samples: int = 64,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """Render a picture of a sensor, seen from -y, slightly from the right and from above.

    Parameters
    ----------
    parts : sequence of ShownPart
        Result of :func:`mitsuba_taxel.report.picture.sensor_parts.shown_parts`.
    width : int
        Width in pixels; the height is 10/16 of the width.
    samples : int
        Samples per pixel, rounded up to a multiple of 16, or to 1, 4 or 9.
    progress : Callable[[int, int], None], optional
        Called with (passes done, total passes).

    Returns
    -------
    (H, W, 3) ndarray
        Linear sRGB; white is 1.

    Raises
    ------
    InputError
        if width or samples are out of range.
    """
    check_whole("width", width, NARROWEST, WIDEST)
    check_whole("samples", samples, 1, MOST_SAMPLES)
    with TemporaryDirectory() as folder:
        live = _instantiate(_description(parts, Path(folder), width))
    per_pass = min(PER_PASS, math.ceil(math.sqrt(samples)) ** 2)
    passes = math.ceil(samples / per_pass)
    total = np.zeros((round(width / ASPECT), width, 3))
    for number in range(passes):
        image = live.integrator().render(live, live.sensors()[0], seed=number, spp=per_pass)
        total += np.array(image, dtype=float)
        if progress:
            progress(number + 1, passes)
    return total / passes


def _instantiate(description: dict[str, Any]) -> Any:
    """A ``mi.Scene`` in :data:`VARIANT`, independent of the active variant."""
    import mitsuba as mi

    getattr(mi, VARIANT)  # loads the variant's types, without which the scene would be an untyped object
    config = mi.parser.ParserConfig(VARIANT)
    config.parallel = False
    state = mi.parser.parse_dict(config, description)
    mi.parser.transform_all(config, state)
    return mi.parser.instantiate(config, state)


def _description(parts: Sequence[ShownPart], folder: Path, width: int) -> dict[str, Any]:
    """The scene of the picture as a Mitsuba dictionary, with its meshes written into a folder."""
    import mitsuba as mi

    to_world = mi.ScalarTransform4f
    shapes = _meshes(parts, folder)
    points = np.concatenate([solid.vertices[solid.triangles].reshape(-1, 3) for solid in parts])
    low, high = points.min(axis=0), points.max(axis=0)
    middle, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
    origin, target = _viewpoint(points)
    lamp = middle + size * np.array([-2.4, -2.4, 3.4])
    ground = [*middle[:2].tolist(), float(low[2] - 1e-3 * size)]
    film = {
        "type": "hdrfilm",
        "width": width,
        "height": round(width / ASPECT),
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": {"type": "gaussian"},
    }
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 4 + 4 * ("indenter" in shapes)},
        "sensor": {
            "type": "perspective",
            "fov": FIELD_OF_VIEW,
            "to_world": to_world().look_at(origin=origin.tolist(), target=target.tolist(), up=[0, 0, 1]),
            "film": film,
            "sampler": {"type": "multijitter"},
        },
        # On matt surfaces, a uniform sky causes no noise with BSDF sampling, but does with emitter sampling.
        "sky": {"type": "constant", "radiance": _rgb(SKY), "sampling_weight": 0.0},
        "lamp": {
            "type": "rectangle",
            "to_world": to_world()
            .look_at(origin=lamp.tolist(), target=middle.tolist(), up=[0, 0, 1])
            .scale(1.5 * size),
            "emitter": {"type": "area", "radiance": _rgb(LAMP)},
        },
        "ground": {
            "type": "rectangle",
            "to_world": to_world().translate(ground).scale(100 * size),
            "bsdf": {"type": "diffuse", "reflectance": _rgb((0.9, 0.9, 0.9))},
        },
        **shapes,
    }


def _meshes(parts: Sequence[ShownPart], folder: Path) -> dict[str, dict[str, Any]]:
    """Join the parts to one mesh for each material, written as files into a folder."""
    corners = np.concatenate([solid.vertices[solid.triangles] for solid in parts])
    normals = np.concatenate([_corner_normals(solid) for solid in parts])
    materials = np.concatenate([solid.material for solid in parts])
    most = most_pressure(parts)
    pressed = [np.zeros(solid.triangles.shape) if solid.pressure is None else solid.pressure for solid in parts]
    colours = _colours(np.concatenate(pressed), most) if most else None
    shapes = {}
    for name in np.unique(materials).tolist():
        file = folder / f"{name}.ply"
        here, shown = materials == name, MATERIALS[name]
        own = colours[here] if colours is not None and shown is _OUTSIDE else None
        _write_ply(file, corners[here], normals[here], own)
        shapes[name] = {"type": "ply", "filename": str(file), "bsdf": shown if own is None else _COLOURED}
        if name == "led":
            shapes[name]["emitter"] = {"type": "area", "radiance": _rgb(GLOW), "sampling_weight": 0.5}
    return shapes


def most_pressure(parts: Sequence[ShownPart]) -> float:
    """Largest contact pressure on the pads of a picture.

    Parameters
    ----------
    parts : sequence of ShownPart
        Parts of the picture.

    Returns
    -------
    float
        Pressure in MPa; 0 without an indenter.
    """
    return max((float(solid.pressure.max()) for solid in parts if solid.pressure is not None), default=0.0)


def _colours(pressure: np.ndarray, most: float) -> np.ndarray:
    """Linear colours (T, 3, 3) of the triangles' corners on the outside of a pad: colours for pressures or, without
    pressure, the colour of the material."""
    return np.where(pressure[..., None] > 0, _linear_colours(pressure, most), _SHELL)


def _linear_colours(pressure: np.ndarray, most: float) -> np.ndarray:
    """Colours (..., 3), linear RGB, of a colour scale for pressures from 0 to ``most``."""
    from matplotlib import colormaps

    srgb = colormaps["viridis"](pressure / most)[..., :3]
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _corner_normals(solid: ShownPart) -> np.ndarray:
    """Normals (T, 3, 3) at the corners of triangles, equal on both sides of an edge unless it is sharp."""
    normals = area_normals(solid.vertices, solid.triangles)
    directions, pairs = unit(normals), neighbours(solid.triangles)[1]
    first, second = pairs.T
    bend = np.einsum("ij,ij->i", directions[first], directions[second])
    cut = solid.material == "cut"
    smooth = pairs[(bend > math.cos(math.radians(CREASE))) & (cut[first] == cut[second])]
    group = components(len(normals), smooth)
    keys = solid.triangles.astype(np.int64) * len(normals) + group[:, None]
    number = np.unique(keys, return_inverse=True)[1].reshape(-1)
    sums = np.stack([np.bincount(number, weights=np.repeat(column, 3)) for column in normals.T], axis=1)
    return unit(sums)[number].reshape(-1, 3, 3)


def _write_ply(file: Path, corners: np.ndarray, normals: np.ndarray, colours: np.ndarray | None) -> None:
    """Write triangles (T, 3, 3) with normals and optional colours at their corners, without shared vertices, as PLY."""
    of_corners = [corners, normals, *([] if colours is None else [colours])]
    count = len(corners)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {3 * count}"]
    header += [f"property float {name}" for name in _PROPERTIES[: 3 * len(of_corners)]]
    header += [f"element face {count}", "property list uchar int vertex_indices", "end_header", ""]
    faces = np.empty(count, dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, np.arange(3 * count).reshape(-1, 3)
    points = np.concatenate(of_corners, axis=2).astype("<f4")
    file.write_bytes("\n".join(header).encode() + points.tobytes() + faces.tobytes())


def _viewpoint(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position and target of the camera, such that points (N, 3) fill its view."""
    azimuth, elevation = math.radians(AZIMUTH), math.radians(ELEVATION)
    level = math.cos(elevation)
    towards_viewer = np.array([math.sin(azimuth) * level, -math.cos(azimuth) * level, math.sin(elevation)])
    right = unit(np.cross([0.0, 0.0, 1.0], towards_viewer))
    up = np.cross(towards_viewer, right)
    slope = math.tan(math.radians(FIELD_OF_VIEW / 2)) / MARGIN
    target, distance = 0.5 * (points.min(axis=0) + points.max(axis=0)), 0.0
    for _ in range(8):  # centre and size of the view depend weakly on each other
        x, y, depth = ((points - target) @ axis for axis in (right, up, towards_viewer))
        distance = float(max((np.abs(x) / slope + depth).max(), (np.abs(y) * ASPECT / slope + depth).max()))
        u, v = x / (distance - depth), y / (distance - depth)
        target = target + 0.5 * distance * ((u.min() + u.max()) * right + (v.min() + v.max()) * up)
    return target + distance * towards_viewer, target
