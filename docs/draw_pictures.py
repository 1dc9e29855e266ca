"""Draw the pictures of the gallery and of the plugins' reference.

python docs/draw_pictures.py [NAME...]

NAME is a scene of `docs/gallery` or a plugin; without one, all are drawn. Pictures are PNG with a palette, below 60 kB.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import mitsuba_taxel  # noqa: F401, before Mitsuba, for its LLVM

# isort: split
import drjit as dr
import matplotlib
import mitsuba as mi
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from mitsuba_taxel import Pad, PadSensor, Wall, measure
from mitsuba_taxel.plots.figures import save_small

DOCS = Path(__file__).parent
GALLERY, PLUGINS = DOCS / "gallery", DOCS / "pictures" / "plugins"
WIDTH = 640
ARGUMENTS = {
    "hexagonal": ["hexagonal.xml", "-D", "fz=-10"],  # ships with the package
    "rounded_edges": ["rounded_edges.xml", "-D", "fz=0"],
}
"""Scene and parameters of pictures of the gallery that are not those of a file with its defaults."""
REGIONS = {"roof": (0.9, 0.35, 0.05), "side": (0.85, 0.65, 0.05), "top": (0.05, 0.2, 0.6), "outer": (0.3, 0.5, 0.8)}
"""Linear colours of the regions of a pad, in the picture of `region`."""
SAMPLES = 1 << 20


def sensor_picture(file: Path, *scene: str) -> None:
    """Run `taxel picture`, and write its picture with a palette."""
    with TemporaryDirectory() as folder:
        full = Path(folder) / "picture.png"
        command = [Path(sys.executable).with_name("taxel"), "picture", *scene, "--width", str(WIDTH), "-o", full]
        subprocess.run(command, check=True, cwd=GALLERY, stdout=subprocess.DEVNULL)
        write_small(full, file)


def write_small(full: Path, file: Path) -> None:
    """Write a picture as PNG with a palette that keeps colours of small areas, such as the LEDs'."""
    picture = Image.open(full).convert("RGB")
    picture.quantize(160, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(file, optimize=True)


def draw_gallery(name: str) -> None:
    sensor_picture(GALLERY / f"{name}.png", *ARGUMENTS.get(name, [f"{name}.xml"]))


def draw_deformable_pad(file: Path) -> None:
    sensor_picture(file, "pad.xml", "-D", "cell=spherical", "-D", "fx=4", "-D", "fz=-12")


def draw_photo_reflector(file: Path) -> None:
    with TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.xml"
        packages = '<shape type="photo_reflector"> <integer name="rows" value="2"/> <integer name="columns" value="3"/>'
        dies = '<emitter type="annular_led"/> <sensor type="phototransistor"/>'
        scene.write_text(f'<scene version="3.9.0"> {packages} {dies} </shape> </scene>')
        sensor_picture(file, str(scene), "--cut", "none")


def draw_region(file: Path) -> None:
    """Draw a pad with a colour for each region."""
    from mitsuba_taxel.report.picture import drawing
    from mitsuba_taxel.report.picture.sensor_parts import shown_parts

    colours = {
        name: {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(colour)}}}
        for name, colour in REGIONS.items()
    }
    usual = dict(drawing.MATERIALS)
    drawing.MATERIALS.update(colours)
    try:
        parts, _ = shown_parts(PadSensor(Pad("hemispheric", rows=1, columns=2)).scene().load(), "middle", 1.0)
        pixels = drawing.render_parts(parts, width=WIDTH, samples=64)
    finally:
        drawing.MATERIALS.update(usual)
    with TemporaryDirectory() as folder:
        full = Path(folder) / "picture.png"
        drawing.write_picture(pixels, full)
        write_small(full, file)


def draw_annular_led(file: Path) -> None:
    """Plot radiant intensity against angle, and points of emission of both outlines."""
    figure = new_figure()
    polar = figure.add_subplot(1, 2, 1, projection="polar")
    half_plane(polar, "radiant intensity [W/sr]")
    theta = np.radians(np.linspace(-89.9, 89.9, 721))
    directions = mi.Vector3f(np.sin(theta), 0 * theta, np.cos(theta))
    laws = {
        "uniform_solid_angle, 60°": {"law": "uniform_solid_angle", "cone_angle": 60.0},
        "lambertian": {"law": "lambertian"},
        "cosine_power, m = 8": {"law": "cosine_power", "exponent": 8.0},
    }
    for label, law in laws.items():
        led = mi.load_dict({"type": "annular_led", **law})
        polar.plot(theta, np.array(led.law.density(directions)), label=label)
    polar.set_yticks([0.5, 1.0])
    polar.legend(loc="upper center", bbox_to_anchor=(0.5, 0.22), fontsize=8, frameon=False)
    face = figure.add_subplot(1, 2, 2, aspect="equal")
    random = np.random.default_rng(1).random((2, 3000))
    for shape, offset in (("square", -0.2), ("circular", 0.2)):
        rectangle = mi.load_dict({"type": "rectangle", "led": {"type": "annular_led", "shape": shape}})
        points = rectangle.emitter().sample_point(mi.UInt32(np.zeros(3000, int)), mi.Point2f(random))
        x, y = np.array(points)[:2]
        face.plot(x + offset, y, ".", markersize=1.2)
        face.text(offset, 0.16, shape, ha="center", fontsize=9)
    face.set(xlabel="x [mm]", ylabel="y [mm]", ylim=(-0.2, 0.22), title="points of emission")
    save_small(figure, file)


def draw_phototransistor(file: Path) -> None:
    """Plot the reading of a parallel beam against its angle."""
    figure = new_figure()
    axes = figure.add_subplot(xlabel="angle to the normal [degrees]", ylabel="reading relative to that on the axis")
    angle = np.linspace(0, 90, 181)
    cosine = np.cos(np.radians(angle))
    for exponent in (1.0, 2.0, 6.0, 30.0):
        response = {"response": "ideal"} if exponent == 1 else {"response": "cosine_power", "exponent": exponent}
        sensor = mi.load_dict({"type": "phototransistor", **response})
        weight = np.array(sensor.angular_response(mi.Float(cosine)))
        label = "ideal" if exponent == 1 else f"cosine_power, exponent {exponent:g}"
        axes.plot(angle, weight * cosine, label=label)
    axes.legend(frameon=False)
    axes.set(xlim=(0, 90), ylim=(0, None))
    save_small(figure, file)


def draw_wall(file: Path) -> None:
    """Plot light that walls reflect in the plane of incidence, counted from samples, relative to its maximum."""
    figure = new_figure()
    axes = figure.add_subplot(projection="polar")
    half_plane(axes, "light reflected per solid angle, relative to its maximum; incident at 40°")
    incidence = math.radians(40)
    surface = dr.zeros(mi.SurfaceInteraction3f)
    surface.n = mi.Normal3f(0, 0, 1)
    surface.sh_frame = mi.Frame3f(surface.n)
    surface.wi = mi.Vector3f(-math.sin(incidence), 0, math.cos(incidence))
    random = np.random.default_rng(1)
    for label, slope in (("isotropic", None), ("lambertian", None), ("rough_mirror", 8.0), ("mirror", None)):
        wall = mi.load_dict({"type": "wall", "scattering": label, **({"rms_slope": slope} if slope else {})})
        choice, points = mi.Float(random.random(SAMPLES)), mi.Point2f(random.random((2, SAMPLES)))
        sample, weight = wall.sample(mi.BSDFContext(mi.TransportMode.Importance), surface, choice, points)
        x, y, z = np.broadcast_to(np.array(sample.wo), (3, SAMPLES))
        polar, in_plane = np.arctan2(np.hypot(x, y), z) * np.sign(x), np.abs(y) <= 0.3 * np.hypot(x, y)
        weights = np.broadcast_to(np.array(weight)[0], SAMPLES)[in_plane]
        counts, edges = np.histogram(polar[in_plane], 46, (-np.pi / 2, np.pi / 2), weights=weights)
        intensity = counts / np.abs(np.diff(np.cos(edges)))
        axes.plot(0.5 * (edges[1:] + edges[:-1]), intensity / intensity.max(), label=label)
    axes.annotate("", (0, 0), (-incidence, 1), arrowprops={"arrowstyle": "->", "color": "black"})
    axes.set_yticks([])
    axes.legend(loc="center left", bbox_to_anchor=(1.1, 0.6), frameon=False)
    save_small(figure, file)


def draw_integrator(name: str, file: Path) -> None:
    """Draw the irradiance map of one phototransistor, with its reading."""
    import xml.etree.ElementTree as ElementTree

    from mitsuba_taxel import Scene, write_xml

    with TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.xml"
        write_xml(PadSensor(Pad("hemispheric", rows=1, columns=1), roof=Wall("lambertian")).scene(), scene)
        tree = ElementTree.parse(scene)
        tree.find("integrator").set("type", name)
        sensor = next(sensor for sensor in tree.iter("sensor"))
        for film in sensor.findall("film"):
            sensor.remove(film)
        film = ElementTree.SubElement(sensor, "film", type="hdrfilm")
        for key, value in (("width", "26"), ("height", "15")):
            ElementTree.SubElement(film, "integer", name=key, value=value)
        for key, value in (("pixel_format", "luminance"), ("component_format", "float32")):
            ElementTree.SubElement(film, "string", name=key, value=value)
        ElementTree.SubElement(film, "rfilter", type="box")
        tree.write(scene)
        readings = measure(Scene(str(scene)), points=4096, irradiance=True, mechanics_error=False)
    figure = new_figure()
    axes = figure.add_subplot(xlabel="x [mm]", ylabel="y [mm]")
    image = axes.imshow(readings.irradiance, extent=(-0.26, 0.26, -0.15, 0.15), vmin=0.10, vmax=0.26)
    figure.colorbar(image, ax=axes, label="irradiance [W/mm²]", shrink=0.8)
    power, error = 1e3 * readings.power[0], 1e3 * readings.standard_error[0]
    axes.set_title(f"{name}, 32 x 4096 points: {power:.3f} ± {error:.3f} mW", fontsize=10)
    save_small(figure, file)


def draw_owen_sobol(file: Path) -> None:
    """Plot 256 points of two sequences beside random points."""
    figure = new_figure()
    sampler = mi.load_dict({"type": "owen_sobol", "sample_count": 256})
    sampler.seed(0, 512)
    points = np.array(sampler.next_2d()).reshape(2, 2, 256)
    random = np.random.default_rng(0).random((2, 256))
    panels = {"owen_sobol, sequence 1": points[:, 0], "owen_sobol, sequence 2": points[:, 1], "random numbers": random}
    for number, (label, (x, y)) in enumerate(panels.items(), 1):
        axes = figure.add_subplot(1, 3, number, aspect="equal", xlim=(0, 1), ylim=(0, 1), xticks=[], yticks=[])
        axes.plot(x, y, ".", markersize=3)
        axes.set_title(label, fontsize=9)
    save_small(figure, file)


def new_figure() -> Figure:
    return Figure(figsize=(6.4, 3.0), dpi=100, layout="constrained")


def half_plane(axes: matplotlib.axes.Axes, title: str) -> None:
    """Format polar axes as the half-plane above a surface, with 0 degrees upwards."""
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.set_thetalim(-np.pi / 2, np.pi / 2)
    axes.set_xticks(np.radians([-90, -45, 0, 45, 90]))
    axes.set_title(title, fontsize=9)
    axes.tick_params(labelsize=7)


OF_PLUGINS: dict[str, Callable[[Path], None]] = {
    "deformable_pad": draw_deformable_pad,
    "photo_reflector": draw_photo_reflector,
    "region": draw_region,
    "wall": draw_wall,
    "annular_led": draw_annular_led,
    "phototransistor": draw_phototransistor,
    "owen_sobol": draw_owen_sobol,
    **{
        name: lambda file, name=name: draw_integrator(name, file)
        for name in ("taxel_tracer", "taxel_path", "analog_tracer")
    },
}


def main(names: list[str]) -> None:
    mi.set_variant("llvm_ad_mono")
    scenes = list(dict.fromkeys([*(file.stem for file in sorted(GALLERY.glob("*.xml"))), *ARGUMENTS]))
    for name in names or [*scenes, *OF_PLUGINS]:
        print(name, flush=True)
        if name in OF_PLUGINS:
            OF_PLUGINS[name](PLUGINS / f"{name}.png")
        else:
            draw_gallery(name)


if __name__ == "__main__":
    main(sys.argv[1:])
