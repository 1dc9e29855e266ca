"""The phototransistor: its response against the angle, its responsivity, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_arrays import floats

from mitsuba_taxel import InputError, Scene

REPLICATES = 32
WIDTH, DEPTH = 0.3, 0.2


def write_table(path, rows):
    path.write_text("".join(f"{angle:.17g}, {value:.17g}\n" for angle, value in rows))
    return str(path)


def write_cosine_power(path, exponent, scale=1.0):
    angles = np.linspace(0, 90, 361)
    values = scale * np.cos(np.radians(angles)).clip(0) ** exponent
    return write_table(path, zip(angles, values, strict=True))


def sensor_on_rectangle(mi, **parameters):
    """A phototransistor on a rectangle that is turned and displaced."""
    turn = mi.ScalarTransform4f().translate([0.3, -0.2, 0.7]).rotate([0.6, 0.8, 0], 50)
    sensor = {"type": "phototransistor", "width": WIDTH, "depth": DEPTH, **parameters}
    scene = mi.load_dict({"type": "scene", "r": {"type": "rectangle", "to_world": turn, "sensor": sensor}})
    return scene, scene.sensors()[0]


def random_points(mi, count, seed):
    rng = mi.PCG32(size=count, initstate=seed)
    return mi.Point2f(rng.next_float32(), rng.next_float32())


@pytest.mark.parametrize("exponent", [1.0, 1.5, 4.0, 100.0])
def test_uniform_sky(llvm_mono, exponent):
    """Under radiance L from everywhere it reads 2 pi L A / (m + 1); Gauss' quadrature over the cosine."""
    _, sensor = sensor_on_rectangle(llvm_mono, response="cosine_power", exponent=exponent)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    cosine = (nodes + 1) / 2
    response = sensor.response(llvm_mono.Float(cosine)).numpy().astype(float)
    assert weights @ (response * cosine) * np.pi == pytest.approx(2 * np.pi / (exponent + 1), rel=1e-5)


@pytest.mark.parametrize("table", [False, True])
@pytest.mark.parametrize("exponent", [1.0, 4.0])
def test_rays_under_a_uniform_sky(llvm_mono, agree, tmp_path, exponent, table):
    """The same from the rays that stock integrators start at the sensor."""
    parameters = {"response": "cosine_power", "exponent": exponent}
    if table:
        parameters = {"response": "tabulated", "file": write_cosine_power(tmp_path / "response.csv", exponent)}
    _, sensor = sensor_on_rectangle(llvm_mono, **parameters)
    count = REPLICATES << 12
    position, direction = random_points(llvm_mono, count, 1), random_points(llvm_mono, count, 2)
    ray, weight = sensor.sample_ray(0, 0.5, position, direction)
    weight = np.broadcast_to(weight[0].numpy(), count).astype(float).reshape(REPLICATES, -1).mean(axis=1)
    error = weight.std(ddof=1) / np.sqrt(REPLICATES)
    # A table of 0.25 degrees reads up to 1e-5 less; single precision, which leaves no other error if ideal, rounds.
    agree(weight.mean(), np.hypot(error, 3e-5), 2 * np.pi / (exponent + 1), replicates=REPLICATES)


@pytest.mark.parametrize("exponent", [1.0, 1e2, 1e4, "table"])
def test_rays_are_distributed_as_the_response(llvm_mono, tmp_path, exponent):
    """So each counts by the whole of it, however narrow it is: 2 pi / (m + 1), and that of a linear table."""
    parameters, expected = {"response": "cosine_power", "exponent": exponent}, 0.0
    if exponent == "table":
        file, end = write_table(tmp_path / "response.csv", [(0, 1), (10, 0)]), np.radians(10)
        parameters, expected = {"response": "tabulated", "file": file}, 2 * np.pi * (1 - np.sin(end) / end)
    expected = expected or 2 * np.pi / (exponent + 1)
    _, sensor = sensor_on_rectangle(llvm_mono, **parameters)
    count = 1 << 10
    _, weight = sensor.sample_ray(0, 0.5, random_points(llvm_mono, count, 1), random_points(llvm_mono, count, 2))
    weight = np.broadcast_to(weight[0].numpy(), count) / expected
    assert weight.mean() == pytest.approx(1, abs=1e-3) and weight.std() < 0.01


def test_ideal_is_the_default(llvm_mono):
    mi = llvm_mono
    _, sensor = sensor_on_rectangle(mi)
    assert np.all(sensor.response(mi.Float([1e-30, 0.3, 1])).numpy() == 1)
    _, weight = sensor.sample_ray(0, 0.5, random_points(mi, 100, 1), random_points(mi, 100, 2))
    assert np.allclose(weight[0].numpy() * WIDTH * DEPTH, np.pi * WIDTH * DEPTH)


@pytest.mark.parametrize("exponent", [1.0, 3.0])
def test_connections_and_radiance_have_the_response(llvm_mono, exponent):
    """`sample_direction` weighs by cos(theta)**m / distance², `eval` by cos(theta)**(m - 1) / area, in front only."""
    import drjit as dr

    mi = llvm_mono
    _, sensor = sensor_on_rectangle(mi, response="cosine_power", exponent=exponent)
    faces = sensor.faces
    it = dr.zeros(mi.SurfaceInteraction3f, 1000)
    height = floats(mi, np.where(np.arange(1000) % 2, 0.5, -0.5))
    it.p = faces.origin + faces.frame.to_world(mi.Vector3f(0.4, -0.3, height))
    ds, weight = sensor.sample_direction(it, random_points(mi, 1000, 1))
    local = faces.frame.to_local(it.p - ds.p).numpy().astype(float)
    squared = np.sum(local**2, axis=0)
    expected = np.maximum(local[2], 0) ** exponent / squared ** (exponent / 2 + 1)
    assert weight[0].numpy() == pytest.approx(expected, rel=1e-4)

    si = dr.zeros(mi.SurfaceInteraction3f, 3)
    si.sh_frame = mi.Frame3f(faces.frame)
    si.wi = dr.normalize(mi.Vector3f([0, 0.6, 0.6], 0, [1, 0.8, -0.8]))
    expected = np.array([1, 0.8 ** (exponent - 1), 0]) / (WIDTH * DEPTH)
    assert sensor.eval(si)[0].numpy() == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("exponent", [1.0, 2.0, 5.0])
def test_table_of_a_power_is_that_power(llvm_mono, tmp_path, exponent):
    """Whatever the table's scale; read between its rows, to the accuracy of linear interpolation."""
    mi = llvm_mono
    file = write_cosine_power(tmp_path / "response.csv", exponent, scale=40)
    _, table = sensor_on_rectangle(mi, response="tabulated", file=file)
    _, power = sensor_on_rectangle(mi, response="cosine_power", exponent=exponent)
    cosine = floats(mi, np.cos(np.radians(np.linspace(0, 89, 1001))))
    assert table.response(cosine).numpy() == pytest.approx(power.response(cosine).numpy(), abs=3e-4)


def test_table_is_linear_and_ends(llvm_mono, tmp_path):
    mi = llvm_mono
    file = write_table(tmp_path / "response.csv", [(0, 4), (10, 5), (40, 2)])
    _, sensor = sensor_on_rectangle(mi, response="tabulated", file=file)
    angles = np.array([0, 5, 10, 20, 39.99, 40.01, 80])
    expected = np.array([1, 1.125, 1.25, 1, 0.50025, 0, 0]) / np.cos(np.radians(angles))
    response = sensor.response(floats(mi, np.cos(np.radians(angles)))).numpy()
    assert response == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("response", ["ideal", "cosine_power", "tabulated"])
def test_response_is_finite(llvm_mono, tmp_path, response):
    """Also of a table that is not zero at 90 degrees, and for the rounded cosines of grazing light."""
    mi = llvm_mono
    parameters = {"cosine_power": {"exponent": 1e4}, "ideal": {}}.get(response)
    if parameters is None:
        parameters = {"file": write_table(tmp_path / "response.csv", [(0, 1), (90, 1)])}
    _, sensor = sensor_on_rectangle(mi, response=response, **parameters)
    cosine = np.array([1e-44, 1e-38, 1e-30, 1e-7, 0.5, 1 - 2**-24, 1, 1 + 2**-23], dtype=np.float32)
    values = sensor.response(floats(mi, cosine)).numpy()
    assert np.all(np.isfinite(values)) and np.all(values >= 0)
    assert values[-1] == pytest.approx(1, rel=1e-5)


def test_responsivity(llvm_mono):
    """eta e lambda / (h c): an electron for each photon of 925 nm is 0.7461 A/W."""
    _, ideal = sensor_on_rectangle(llvm_mono)
    _, real = sensor_on_rectangle(llvm_mono, quantum_efficiency=0.6)
    photon = 6.62607015e-34 * 299792458 / 925e-9
    assert ideal.responsivity(925) == pytest.approx(1.602176634e-19 / photon, rel=1e-12)
    assert ideal.responsivity(925) == pytest.approx(0.7461, abs=5e-5)
    assert real.responsivity(500) == pytest.approx(0.6 * ideal.responsivity(925) * 500 / 925, rel=1e-12)
    with pytest.raises(InputError, match="wavelength_nm = 0 is not allowed"):
        ideal.responsivity(0)


def test_other_numbers_need_no_other_kernel(llvm_mono, tmp_path):
    import drjit as dr

    mi = llvm_mono

    def kernels(**parameters):
        _, sensor = sensor_on_rectangle(mi, **parameters)
        sample = random_points(mi, 1000, 1)
        dr.eval(sample)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            dr.eval(sensor.response(sample.x))
            return [entry for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT]

    a = write_table(tmp_path / "a.csv", [(0, 4), (10, 5), (40, 2)])
    b = write_table(tmp_path / "b.csv", [(0, 1), (90, 0)])
    for first, second in (
        ({"response": "cosine_power", "exponent": 1.0}, {"response": "cosine_power", "exponent": 2.5}),
        ({"response": "tabulated", "file": a}, {"response": "tabulated", "file": b}),
    ):
        kernels(**first)
        again = kernels(**second)
        assert again and all(entry["cache_hit"] for entry in again)


def test_scene_finds_the_table_beside_it(llvm_mono, tmp_path):
    write_table(tmp_path / "response.csv", [(0, 1), (60, 0)])
    load(tmp_path, TABULATED)


TABULATED = '<string name="response" value="tabulated"/> <string name="file" value="response.csv"/>'


def load(folder, parameters):
    sensor = f'<sensor type="phototransistor">{parameters}</sensor>'
    (folder / "scene.xml").write_text(f'<scene version="3.9.0"><shape type="rectangle">{sensor}</shape></scene>')
    return Scene.from_file(folder / "scene.xml").load()


@pytest.mark.parametrize(
    "parameters, table, message",
    [
        (
            '<string name="response" value="real"/>',
            "",
            "response = 'real' is not allowed: one of ideal, cosine_power, tabulated",
        ),
        (
            '<string name="response" value="cosine_power"/> <float name="exponent" value="0.9"/>',
            "",
            "exponent = 0.9 .* from 1 to 10000",
        ),
        ('<float name="exponent" value="2"/>', "", "exponent"),
        ('<string name="file" value="response.csv"/>', "", "file"),
        ('<float name="quantum_efficiency" value="0"/>', "", "quantum_efficiency = 0 .* above 0 and of at most 1"),
        ('<float name="quantum_efficiency" value="1.1"/>', "", "quantum_efficiency = 1.1"),
        (TABULATED, None, "file = 'response.csv' cannot be read"),
        (TABULATED, "degrees,response\n0,1\n90,none\n", "two columns of numbers are needed"),
        (TABULATED, "0,1\n20,1\n20,0.5\n", "the angle 20 in row 3"),
        (TABULATED, "0,1\n20,-0.5\n", "the value -0.5 in row 2"),
        (TABULATED, "0,1\n20,nan\n", "the value nan in row 2"),
        (TABULATED, "0,0\n20,1\n", "the value 0 at 0 degrees is not allowed: above 0"),
        (TABULATED, "0,1e-9\n20,1\n", "the value 1e-09 at 0 degrees .* a millionth of the largest, 1e-06, is needed"),
    ],
)
def test_bad_parameters_are_refused_in_one_line(llvm_mono, tmp_path, parameters, table, message):
    if table is not None:
        (tmp_path / "response.csv").write_text(table)
    with pytest.raises(InputError, match=message) as caught:
        load(tmp_path, parameters)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("table", [False, True])
def test_stock_integrators_agree(llvm_mono, agree, tmp_path, table):
    """Light traced from a round LED and from the phototransistor, over a plate, give the same effective power."""
    mi = llvm_mono
    led, response = {"law": "cosine_power", "exponent": 2.0}, {"response": "cosine_power", "exponent": 3.0}
    if table:
        file = write_table(tmp_path / "table.csv", [(0, 1), (20, 0.9), (40, 0.3), (70, 0)])
        led, response = {"law": "tabulated", "file": file}, {"response": "tabulated", "file": file}
    above = mi.ScalarTransform4f().translate([0, 0, 0.7]).rotate([1, 0, 0], 180).scale(2)
    scene = {
        "type": "scene",
        "plate": {"type": "rectangle", "to_world": above, "bsdf": {"type": "wall"}},
        "reflector": {
            "type": "photo_reflector",
            "spacing": 0.7,
            "to_world": mi.ScalarTransform4f().translate([0, 0, -0.5]),
            "led": {"type": "annular_led", "shape": "circular", **led},
            "sensor": {"type": "phototransistor", "width": WIDTH, "depth": DEPTH, **response},
        },
    }
    live = mi.load_dict(scene)
    readings = {}
    for integrator in ("path", "ptracer"):
        tracer = mi.load_dict({"type": integrator, "max_depth": 3})
        power = [np.array(mi.render(live, integrator=tracer, spp=1 << 14, seed=s)).mean() for s in range(8)]
        readings[integrator] = np.mean(power), np.std(power, ddof=1) / np.sqrt(8)
    assert all(0 < error < 0.01 * power for power, error in readings.values())
    agree(*readings["path"], *readings["ptracer"], replicates=8)


def test_rendering_gives_the_irradiance_that_the_reading_says(llvm_mono):
    """`mi.render` on a scene with a film of one pixel per taxel: pixel times area is the power."""
    import numpy as np

    from mitsuba_taxel import measure

    mi = llvm_mono
    live = Scene.from_file("pad.xml").load()
    image = mi.render(live, spp=1 << 14).numpy()
    assert image.shape == (3, 3, 1)
    reading = measure(live, points=1024)
    assert np.allclose(image[:, :, 0].ravel() * 0.52 * 0.3, reading.power, rtol=0.02)
    assert np.allclose(np.array(live.sensors()[0].film().bitmap()), image[:, :, 0])
