"""The LED: outlines, directional laws from numbers and from tables, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from chi_square import SIGNIFICANCE
from kernel_arrays import floats, vectors

from mitsuba_taxel import AnnularLed, InputError, Scene

pytestmark = pytest.mark.quick

REPLICATES = 32

TABLES = {
    "data sheet": [(0, 1), (10, 0.98), (20, 0.9), (30, 0.71), (40, 0.42), (50, 0.2), (60, 0.08), (75, 0.01), (90, 0)],
    "batwing that ends at a step": [(0, 0.3), (25, 1), (40, 1), (60, 0.5)],
    "ring": [(0, 0), (30, 0), (30.001, 7), (30.002, 0), (90, 0)],
    "narrow": [(0, 2e-300), (0.001, 1e-300)],
}


def write_table(path, rows):
    path.write_text("# degrees, relative\n" + "".join(f"{angle:.17g}, {value:.17g}\n" for angle, value in rows))
    return str(path)


def law_of(mi, **parameters):
    from mitsuba_taxel.kernels.taxels import emission

    return emission.law_of(AnnularLed(**parameters))


def random_points(mi, count, seed=0):
    rng = mi.PCG32(size=count, initstate=seed)
    return mi.Point2f(rng.next_float32(), rng.next_float32())


def polar_angles(d):
    x, y, z = (component.numpy().astype(float) for component in d)
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


@pytest.mark.parametrize("exponent", [0.0, 0.3, 1.0, 40.0, 1e4, 1e6])
def test_cosine_power(llvm_mono, exponent):
    """cos(theta)**(m + 1) is uniform, round the axis too, and the density is the closed form; three tests each."""
    from scipy import stats

    law = law_of(llvm_mono, law="cosine_power", exponent=exponent)
    d = law.sample(random_points(llvm_mono, 100_000))
    theta, phi = polar_angles(d)
    log_cos = 0.5 * np.log1p(-(np.sin(theta) ** 2))
    assert stats.kstest(np.exp((exponent + 1) * log_cos), "uniform").pvalue > SIGNIFICANCE
    assert stats.kstest(phi / (2 * np.pi) + 0.5, "uniform").pvalue > SIGNIFICANCE
    expected = (exponent + 1) / (2 * np.pi) * np.exp(exponent * log_cos)
    np.testing.assert_allclose(law.density(d).numpy(), expected, rtol=1e-4)


@pytest.mark.parametrize("exponent", [0.0, 1e4, 1e6])
def test_cosine_power_is_finite_everywhere(llvm_mono, exponent):
    mi = llvm_mono
    law = law_of(mi, law="cosine_power", exponent=exponent)
    d = law.sample(mi.Point2f([0, 1e-30, 0.5, 1 - 2**-24], 0.25))
    assert np.allclose(np.linalg.norm(d.numpy(), axis=0), 1, rtol=1e-6)
    z = np.array([1, 0.5, 1e-3, 1e-30, 1e-42, 0, -1e-30, -1])
    density = law.density(vectors(mi, np.sqrt(1 - z**2), 0, z)).numpy()
    assert np.all(np.isfinite(density)) and np.all(density >= 0) and np.all(density[z <= 0] == 0)


@pytest.mark.parametrize("name", TABLES)
def test_tabulated(llvm_mono, tmp_path, name):
    """Sampled polar angles follow the table, integrated by quadrature, and so does the density."""
    from scipy import stats

    rows = np.array(TABLES[name], dtype=float)
    law = law_of(llvm_mono, law="tabulated", file=write_table(tmp_path / "led.csv", rows))
    theta, phi = polar_angles(law.sample(random_points(llvm_mono, 100_000)))
    fine = np.unique(np.concatenate([np.linspace(a, b, 2000) for a, b in zip(rows[:-1, 0], rows[1:, 0], strict=True)]))
    centre = np.radians((fine[1:] + fine[:-1]) / 2)
    intensity = np.interp(np.degrees(centre), rows[:, 0], rows[:, 1] / rows[:, 1].max())
    share = 2 * np.pi * intensity * np.sin(centre) * np.diff(np.radians(fine))
    cumulative = np.concatenate([[0], np.cumsum(share)])
    # Single precision moves a direction by up to 1e-7, which is a part in 100 of the narrowest feature here.
    blur = 2e-7 / np.radians(np.ptp(rows[rows[:, 1] > 0, 0]) or 0.001)
    distance = stats.kstest(theta, lambda t: np.interp(t, np.radians(fine), cumulative / cumulative[-1])).statistic
    assert distance < stats.kstwo.isf(SIGNIFICANCE, theta.size) + blur
    assert stats.kstest(phi / (2 * np.pi) + 0.5, "uniform").pvalue > SIGNIFICANCE
    d = vectors(llvm_mono, np.sin(centre), 0, np.cos(centre))
    expected = intensity / cumulative[-1]
    allowed = np.maximum(5e-4 * expected, (1e-5 + blur) * expected.max())
    assert np.all(np.abs(law.density(d).numpy() - expected) <= allowed)


def test_table_of_a_cosine_is_lambertian(llvm_mono, tmp_path):
    angles = np.linspace(0, 90, 181)
    rows = np.stack([angles, 17 * np.cos(np.radians(angles)).clip(0)], axis=1)
    table = law_of(llvm_mono, law="tabulated", file=write_table(tmp_path / "led.csv", rows))
    lambertian = law_of(llvm_mono, law="lambertian")
    d = llvm_mono.warp.square_to_uniform_hemisphere(random_points(llvm_mono, 10_000))
    np.testing.assert_allclose(table.density(d).numpy(), lambertian.density(d).numpy(), rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize(
    "parameters",
    [
        {"law": "cosine_power", "exponent": 0.0},
        {"law": "cosine_power", "exponent": 2.5},
        {"law": "cosine_power", "exponent": 1e4},
        *({"law": "tabulated", "table": name} for name in TABLES),
    ],
)
def test_laws_integrate_to_one(llvm_mono, tmp_path, parameters):
    """Gauss' quadrature over 1 - cos(theta), between the rows of the table."""
    parameters = dict(parameters)
    ends = np.array([0, 1, 5, 90.0])
    if "table" in parameters:
        rows = TABLES[parameters.pop("table")]
        parameters["file"] = write_table(tmp_path / "led.csv", rows)
        ends = np.array([angle for angle, _ in rows], dtype=float)
    law = law_of(llvm_mono, **parameters)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    ends = 2 * np.sin(np.radians(ends) / 2) ** 2
    total = 0.0
    for left, right in zip(ends[:-1], ends[1:], strict=True):
        u = left + (right - left) * (nodes + 1) / 2
        sine = np.sqrt(u * (2 - u))
        density = law.density(vectors(llvm_mono, sine, 0, 1 - u)).numpy().astype(float)
        total += 0.5 * (right - left) * 2 * np.pi * (weights @ density)
    # Single precision rounds 1 - cos(theta) by up to 6e-8, away from the axis.
    rounding = 6e-8 / np.diff(ends[1:]).min(initial=1)
    assert total == pytest.approx(1, abs=1e-5 + rounding)


def led_on(mi, **parameters):
    """An LED on a rectangle that is turned and displaced."""
    turn = mi.ScalarTransform4f().translate([0.3, -0.2, 0.7]).rotate([0.6, 0.8, 0], 50)
    rectangle = {"type": "rectangle", "to_world": turn, "led": {"type": "annular_led", **parameters}}
    scene = mi.load_dict({"type": "scene", "r": rectangle})
    return scene, scene.emitters()[0]


def unroll(shape, x, y):
    """Coordinates in which the annulus is a rectangle: squared distance from the centre, and way round in [0, 1)."""
    if shape == "circular":
        return x**2 + y**2, np.arctan2(y, x) / (2 * np.pi) % 1
    half = np.maximum(np.abs(x), np.abs(y))
    upright = np.abs(x) == half
    side = np.where(upright, np.where(x > 0, 0, 1), np.where(y > 0, 2, 3))
    return half**2, (side + (np.where(upright, y, x) / half + 1) / 2) / 4


@pytest.mark.parametrize("hole", [0.0, 0.1, 0.2498])
@pytest.mark.parametrize("shape", ["square", "circular"])
def test_points_are_uniform_on_the_annulus(llvm_mono, shape, hole):
    """Chi-square test on 20 x 20 cells of equal area."""
    from scipy import stats

    _, led = led_on(llvm_mono, shape=shape, hole=hole)
    ps, weight = led.sample_position(0, random_points(llvm_mono, 400_000))
    offset = led.faces.locate(ps.p)[1]
    squared, turn = unroll(shape, *offset.numpy().astype(float))
    depth = (squared - (hole / 2) ** 2) / (0.125**2 - (hole / 2) ** 2)
    assert depth.min() > -0.01 and depth.max() < 1.01  # the ring is as thin as 1000 roundings of the position
    counts, _, _ = np.histogram2d(np.clip(depth, 0, 1), turn, bins=20, range=[[0, 1], [0, 1]])
    assert stats.chisquare(counts.ravel()).pvalue > SIGNIFICANCE
    area = (0.25**2 - hole**2) * (np.pi / 4 if shape == "circular" else 1)
    assert np.allclose(weight.numpy(), area, rtol=1e-4) and np.allclose(ps.pdf.numpy(), 1 / area, rtol=1e-4)
    assert np.mean(led.pdf_position(ps).numpy() > 0) > 0.99


@pytest.mark.parametrize("hole", [0.0, 0.1])
@pytest.mark.parametrize("shape", ["square", "circular"])
def test_annulus_map_is_continuous(llvm_mono, shape, hole):
    """Neighbours on the unit square, whose upper and lower edge are one, stay neighbours."""
    _, led = led_on(llvm_mono, shape=shape, hole=hole)
    t = np.arange(1025) / 1025
    for depth in (0.0, 0.3, 1 - 2**-24):
        x, y = led.faces.locate(led.sample_point(0, llvm_mono.Point2f(depth, floats(llvm_mono, t))))[1].numpy()
        steps = np.hypot(np.diff(x, append=x[0]), np.diff(y, append=y[0]))
        assert steps.max() < 8 * 0.125 / 1024 * 1.001
    x, y = led.faces.locate(led.sample_point(0, llvm_mono.Point2f(floats(llvm_mono, t), 0.6)))[1].numpy()
    assert np.hypot(np.diff(x), np.diff(y))[1:].max() < 0.01


@pytest.mark.parametrize("shape", ["square", "circular"])
@pytest.mark.parametrize(
    "law",
    [{"law": "uniform_solid_angle"}, {"law": "cosine_power", "exponent": 3.0}, {"law": "tabulated", "table": True}],
)
def test_rays_and_radiance_agree(llvm_mono, agree, tmp_path, shape, law):
    """Power and moments of the light, from its rays and from its radiance integrated over points and directions."""
    mi = llvm_mono
    law = dict(law)
    if law.pop("table", False):
        law["file"] = write_table(tmp_path / "led.csv", TABLES["batwing that ends at a step"])
    _, led = led_on(mi, shape=shape, power=0.7, **law)
    frame = led.faces.frame
    count = REPLICATES * (1 << 13)

    ray, weight = led.sample_ray(0, 0.5, random_points(mi, count, 1), random_points(mi, count, 2))
    from_rays = moments(led, ray.o, frame.to_local(ray.d), weight[0])

    si = mi.SurfaceInteraction3f(led.sample_position(0, random_points(mi, count))[0], mi.Color0f())
    offset = (random_points(mi, count, 3) - 0.5) * 0.25
    si.p = led.faces.point(mi.UInt32(0), offset)
    si.sh_frame = mi.Frame3f(frame)
    si.wi = mi.warp.square_to_uniform_hemisphere(random_points(mi, count, 4))
    radiance = led.eval(si)[0] * si.wi.z * (2 * np.pi * 0.25**2)
    from_radiance = moments(led, si.p, si.wi, radiance)

    assert np.allclose(from_rays[0][0], 0.7)
    agree(from_rays[0][1:], from_rays[1][1:], from_radiance[0][1:], from_radiance[1][1:], REPLICATES)
    agree(from_radiance[0][0], from_radiance[1][0], 0.7, replicates=REPLICATES)


def moments(led, p, d, weight):
    """Means of weight times 1, cos, cos**2, squared offset and offset times direction, with standard errors."""
    offset = led.faces.locate(p)[1].numpy().astype(float) / 0.125
    d = d.numpy().astype(float)
    weight = np.broadcast_to(weight.numpy().astype(float), d.shape[1])
    factors = np.stack([np.ones_like(weight), d[2], d[2] ** 2, np.sum(offset**2, axis=0), offset[0] * d[0]])
    means = (factors * weight).reshape(len(factors), REPLICATES, -1).mean(axis=2)
    return means.mean(axis=1), means.std(axis=1, ddof=1) / np.sqrt(REPLICATES)


@pytest.mark.parametrize("shape", ["square", "circular"])
def test_connections_agree_with_the_radiance(llvm_mono, shape):
    """The weight of a sampled direction is radiance over density, both asked for anew."""
    import drjit as dr

    mi = llvm_mono
    _, led = led_on(mi, shape=shape, law="cosine_power", exponent=2.0)
    it = dr.zeros(mi.SurfaceInteraction3f, 10_000)
    it.p = mi.Point3f(led.faces.origin) + led.faces.frame.to_world(mi.Vector3f(0.1, 0.3, 0.5))
    ds, weight = led.sample_direction(it, random_points(mi, 10_000))
    density = led.pdf_direction(it, ds).numpy()
    inside = density > 0  # rounding puts points of the very rim outside
    assert inside.mean() > 0.999
    assert np.allclose(ds.pdf.numpy()[inside], density[inside], rtol=1e-4)
    value = led.eval_direction(it, ds)[0].numpy()
    assert np.allclose((weight[0] * ds.pdf).numpy()[inside], value[inside], rtol=1e-4)


def test_scene_finds_the_table_beside_it(llvm_mono, tmp_path):
    """All power of a round LED with a table reaches a phototransistor that all but covers its sky."""
    from mitsuba_taxel import measure

    write_table(tmp_path / "led.csv", TABLES["data sheet"])
    (tmp_path / "scene.xml").write_text(
        """<scene version="3.9.0">
            <integrator type="taxel_tracer"> <string name="strategy" value="unidirectional_hits"/> </integrator>
            <shape type="rectangle">
                <emitter type="annular_led">
                    <float name="wavelength" value="940"/> <string name="shape" value="circular"/>
                    <string name="law" value="tabulated"/> <string name="file" value="led.csv"/>
                </emitter>
            </shape>
            <shape type="rectangle">
                <transform name="to_world">
                    <rotate x="1" angle="180"/> <scale value="200"/> <translate z="0.01"/>
                </transform>
                <sensor type="phototransistor"> <float name="width" value="400"/> <float name="depth" value="400"/>
                </sensor>
            </shape>
        </scene>"""
    )
    live = Scene.from_file(tmp_path / "scene.xml").load()
    assert live.emitters()[0].wavelength == 940
    assert measure(live, points=256).power[0] == pytest.approx(1, rel=1e-6)


def test_other_numbers_need_no_other_kernel(llvm_mono, tmp_path):
    import drjit as dr

    mi = llvm_mono

    def kernels(**parameters):
        _, led = led_on(mi, **parameters)
        sample = random_points(mi, 1000)
        dr.eval(sample)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            d = led.sample_direction_of_emission(sample)
            dr.eval(led.sample_point(0, sample), d, led.density_of_direction(d))
            return [entry for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT]

    for first, second in (
        ({"law": "cosine_power", "exponent": 1.0}, {"law": "cosine_power", "exponent": 0.0, "hole": 0.0}),
        (
            {"law": "tabulated", "file": write_table(tmp_path / "a.csv", TABLES["data sheet"])},
            {"law": "tabulated", "file": write_table(tmp_path / "b.csv", [(0, 1), (30, 1)]), "size": 0.2},
        ),
    ):
        kernels(shape="circular", **first)
        again = kernels(shape="circular", **second)
        assert again and all(entry["cache_hit"] for entry in again)


TABULATED = '<string name="law" value="tabulated"/> <string name="file" value="led.csv"/>'


@pytest.mark.parametrize(
    "parameters, table, message",
    [
        ('<string name="shape" value="round"/>', "", "shape = 'round' is not allowed: one of square, circular"),
        ('<string name="shape" value="circular"/> <float name="hole" value="0.3"/>', "", "hole = 0.3 .* size = 0.25"),
        ('<float name="wavelength" value="0"/>', "", "wavelength = 0 .* above 0"),
        ('<float name="exponent" value="2"/>', "", "exponent"),
        ('<string name="law" value="lambertian"/> <string name="file" value="led.csv"/>', "", "file"),
        (
            '<string name="law" value="cosine_power"/> <float name="exponent" value="-0.1"/>',
            "",
            r"exponent = -0.1 .* from 0 to 1e\+06",
        ),
        ('<string name="law" value="cosine_power"/> <float name="cone_angle" value="8"/>', "", "cone_angle"),
        ('<string name="law" value="tabulated"/>', "", "file is missing: the name of a CSV file"),
        ('<string name="law" value="tabulated"/> <float name="file" value="1"/>', "", "file = 1.0 is not allowed"),
        (TABULATED, None, "file = 'led.csv' cannot be read .*No such file"),
        (TABULATED, b"0,1\n90,\xff\xfe", "file = 'led.csv' is not text"),
        (TABULATED, "", "file = 'led.csv' has 0 rows .* from 2 to 4096 rows and 2 columns"),
        (TABULATED, "0,1\n", "has 1 rows"),
        (TABULATED, "0,1,1\n90,0,0\n", "row 1 is not allowed: two columns"),
        (TABULATED, "angle,intensity\n0,1\nhalf,0\n", "row 2 is not allowed: two columns of numbers are needed"),
        (TABULATED, "0,1\n10\n", "row 2 is not allowed: two columns of numbers are needed"),
        (TABULATED, "1,1\n90,0\n", "the angle 1 in row 1 is not allowed: angles must start at 0"),
        (TABULATED, "0,1\n20,1\n20,0.5\n", "the angle 20 in row 3"),
        (TABULATED, "0,1\n20,1\n10,0.5\n", "the angle 10 in row 3 .* at most 90"),
        (TABULATED, "0,1\n91,1\n", "the angle 91 in row 2"),
        (TABULATED, "0,1\ninf,1\ninf,1\n", "the angle inf in row 2"),
        (TABULATED, "0,1\nnan,1\n", "the angle nan in row 2"),
        (TABULATED, "0,1\n20,-0.5\n", "the value -0.5 in row 2 .* at least 0"),
        (TABULATED, "0,1\n20,nan\n", "the value nan in row 2"),
        (TABULATED, "0,1\n20,inf\n", "the value inf in row 2"),
        (TABULATED, "0,0\n90,0\n", "all values are 0"),
    ],
)
def test_bad_parameters_are_refused_in_one_line(llvm_mono, tmp_path, parameters, table, message):
    if table is not None:
        (tmp_path / "led.csv").write_bytes(table if isinstance(table, bytes) else table.encode())
    emitter = f'<emitter type="annular_led">{parameters}</emitter>'
    (tmp_path / "scene.xml").write_text(f'<scene version="3.9.0"><shape type="rectangle">{emitter}</shape></scene>')
    with pytest.raises(InputError, match=message) as caught:
        Scene.from_file(tmp_path / "scene.xml").load()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["angle,intensity\n{}", "angle (deg);intensity\n{}", "Angle\tIntensity\n{}"])
def test_tables_may_have_a_heading_and_other_separators(llvm_mono, tmp_path, text):
    from mitsuba_taxel.kernels.tables import read_angular_table

    rows, mark = "0,1\n30,0.75\n90,0\n", next(one for one in ("\t", ";", ",") if one in text)
    (tmp_path / "led.csv").write_text(text.format(rows.replace(",", mark).replace(".", "." if mark == "," else ",")))
    angles, values = read_angular_table(str(tmp_path / "led.csv"))
    assert angles.tolist() == [0, 30, 90] and values.tolist() == [1, 0.75, 0]
