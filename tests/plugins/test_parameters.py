"""What plugins refuse."""

from __future__ import annotations

import gc

import pytest

from mitsuba_taxel import InputError, Scene

BOTH = '<emitter type="annular_led"/> <sensor type="phototransistor"/>'
LED = '<emitter type="annular_led">{}</emitter>'
SENSOR = '<sensor type="phototransistor">{}</sensor>'
MIXED = '<bsdf type="wall"> <string name="scattering" value="mixed"/>{}</bsdf>'
ROUGH = '<bsdf type="wall"> <string name="scattering" value="rough_mirror"/>{}</bsdf>'


@pytest.mark.parametrize(
    "xml, message",
    [
        ('<bsdf type="wall"> <float name="reflectance" value="1.01"/> </bsdf>', "reflectance = 1.01"),
        ('<bsdf type="wall"> <float name="reflectance" value="nan"/> </bsdf>', "reflectance = nan"),
        ('<bsdf type="wall"> <string name="scattering" value="shiny"/> </bsdf>', "scattering = 'shiny'"),
        (
            '<bsdf type="wall"> <string name="scattering" value="absorbing"/>'
            '<float name="reflectance" value="1"/> </bsdf>',
            "reflectance is not allowed",
        ),
        ('<bsdf type="wall"> <float name="reflectence" value="1"/> </bsdf>', "reflectence"),
        (
            MIXED.format('<float name="specular" value="0.5"/> <float name="isotropic" value="0.4"/>'),
            "specular = 0.5, lambertian = 0, isotropic = 0.4 are not allowed: their sum is 0.9 ",
        ),
        (MIXED.format(""), "their sum is 0 "),
        (
            MIXED.format('<float name="specular" value="-0.5"/> <float name="isotropic" value="1"/>'),
            "specular = -0.5 is not allowed",
        ),
        (
            '<bsdf type="wall"> <float name="specular" value="1"/> </bsdf>',
            "specular is not allowed .* only for 'mixed'",
        ),
        (MIXED.format('<float name="rms_slope" value="1"/>'), "rms_slope is not allowed .* only for 'rough_mirror'"),
        (ROUGH.format(""), "rms_slope is missing: a number from 0.01 to 45"),
        (ROUGH.format('<float name="rms_slope" value="0"/>'), "rms_slope = 0 is not allowed"),
        (ROUGH.format('<float name="rms_slope" value="46"/>'), "rms_slope = 46 is not allowed"),
        (ROUGH.format('<float name="rms_slope" value="0.005"/>'), "rms_slope = 0.005 .* from 0.01 to 45 .* 'mirror'"),
        (
            '<bsdf type="wall"> <string name="reflectance_table" value="a.csv"/> <float name="reflectance" value="1"/>'
            "</bsdf>",
            "reflectance and reflectance_table exclude each other",
        ),
        (
            '<bsdf type="wall"> <string name="scattering" value="absorbing"/>'
            '<string name="reflectance_table" value="a.csv"/> </bsdf>',
            "reflectance_table is not allowed for scattering = 'absorbing'",
        ),
        (
            '<bsdf type="wall"> <string name="reflectance_table" value="no/such.csv"/> </bsdf>',
            "reflectance_table = 'no/such.csv' cannot be read",
        ),
        (
            '<bsdf type="wall"> <float name="reflectance_table" value="0.5"/> </bsdf>',
            "reflectance_table = 0.5 is not allowed: the name of a CSV file",
        ),
        ('<bsdf type="region"/>', "holds no BSDF"),
        (
            '<bsdf type="region"> <bsdf name="ceiling" type="wall"/> </bsdf>',
            "'ceiling' is not a region: allowed are roof, .* phototransistor",
        ),
        (
            f'<shape type="photo_reflector"> {BOTH} <bsdf type="region"> <bsdf name="lid" type="wall"/> </bsdf>'
            "</shape>",
            "'lid' is not a region",
        ),
        (LED.format('<float name="power" value="-1"/>'), "power = -1"),
        (LED.format('<float name="power" value="inf"/>'), "power = inf"),
        (LED.format('<float name="hole" value="0.25"/>'), "hole = 0.25"),
        (LED.format('<float name="cone_angle" value="91"/>'), "cone_angle = 91"),
        (LED.format('<string name="law" value="laser"/>'), "law = 'laser'"),
        (
            LED.format('<string name="law" value="lambertian"/> <float name="cone_angle" value="80"/>'),
            "cone_angle is not allowed for law = 'lambertian', only for 'uniform_solid_angle', 'uniform_polar_angle'",
        ),
        (SENSOR.format('<float name="width" value="0"/>'), "width = 0"),
        (SENSOR.format('<film type="hdrfilm"/>'), "rfilter must be a box"),
        ('<shape type="photo_reflector"/>', "exactly one annular_led"),
        (f'<shape type="photo_reflector">{LED.format("")}</shape>', "exactly one phototransistor"),
        (
            f'<shape type="photo_reflector"> <float name="spacing" value="1"/> {BOTH} </shape>',
            "spacing = 1 is not allowed: from 0.385 .* to 0.94",
        ),
        (
            f'<shape type="photo_reflector"> <float name="spacing" value="0.3"/> {BOTH} </shape>',
            "spacing = 0.3",
        ),
        (
            '<shape type="photo_reflector"> <integer name="rows" value="2"/> <float name="pitch" value="1"/>'
            f"{BOTH} </shape>",
            "pitch = 1 is not allowed: at least 1.06",
        ),
        (
            f'<shape type="photo_reflector"> <transform name="to_world"> <scale x="2"/> </transform>{BOTH} </shape>',
            "to_world must be a rigid motion",
        ),
        ('<shape type="deformable_pad"> <string name="cell" value="round"/> </shape>', "cell = 'round'"),
        ('<shape type="deformable_pad"> <float name="youngs_modulus" value="-4"/> </shape>', "youngs_modulus = -4"),
        ('<shape type="deformable_pad"> <float name="poisson_ratio" value="0.51"/> </shape>', "poisson_ratio = 0.51"),
        ('<shape type="deformable_pad"> <vector name="force" value="0, 0, nan"/> </shape>', "force = "),
        ('<shape type="deformable_pad"> <float name="cell_height" value="4.6"/> </shape>', "break through the top"),
        ('<shape type="deformable_pad"> <float name="pitch" value="2.5"/> </shape>', "the cells overlap"),
        ('<shape type="deformable_pad"> <float name="mesh_size" value="0"/> </shape>', "mesh_size = 0"),
        ('<shape type="deformable_pad"> <integer name="subdivision" value="0"/> </shape>', "subdivision = 0"),
        ('<shape type="deformable_pad"> <string name="finish" value="rusty"/> </shape>', "finish = 'rusty'"),
        ('<shape type="deformable_pad"> <float name="layer_height" value="0.1"/> </shape>', "layer_height"),
        (
            '<shape type="deformable_pad"> <string name="finish" value="grooves"/> </shape>',
            "groove_pitch is missing",
        ),
        (
            '<shape type="deformable_pad"> <string name="finish" value="layer_steps"/>'
            '<float name="layer_height" value="0.1"/> <vector name="print_direction" value="0, 0, 0"/> </shape>',
            "print_direction = ",
        ),
        (
            '<shape type="deformable_pad"> <string name="finish" value="layer_steps"/>'
            '<float name="layer_height" value="0.1"/> <float name="rms_height" value="0.1"/> </shape>',
            "rms_height",
        ),
        (
            '<shape type="deformable_pad"> <string name="finish" value="random"/> <float name="rms_height" value="1"/>'
            '<float name="correlation_length" value="1"/> </shape>',
            "rms_height: walls of the cells would move",
        ),
        (
            '<shape type="deformable_pad"> <string name="finish" value="layer_steps"/>'
            '<float name="layer_height" value="0.001"/> </shape>',
            "layer_height = 0.001 .* triangles",
        ),
        ('<integrator type="taxel_tracer"> <integer name="max_depth" value="-2"/> </integrator>', "max_depth = -2"),
        ('<integrator type="taxel_tracer"> <string name="strategy" value="luck"/> </integrator>', "strategy = 'luck'"),
        ('<sampler type="owen_sobol"> <integer name="sample_count" value="0"/> </sampler>', "sample_count = 0"),
    ],
)
def test_bad_parameters_are_refused_in_one_line(llvm_mono, tmp_path, xml, message):
    path = tmp_path / "scene.xml"
    kind = xml.split(" ")[0][1:]
    if kind in ("emitter", "sensor"):
        xml = f'<shape type="rectangle">{xml}</shape>'
    if kind == "sampler":
        xml = f'<shape type="rectangle"> <sensor type="phototransistor">{xml}</sensor> </shape>'
    path.write_text(f'<scene version="3.9.0">{xml}</scene>')
    with pytest.raises(InputError, match=message) as caught:
        Scene.from_file(path).load()
    assert "\n" not in str(caught.value)


def test_led_must_fit_on_its_rectangle(llvm_mono):
    from mitsuba_taxel import measure

    tiny = llvm_mono.ScalarTransform4f().scale(0.05)
    scene = {
        "type": "scene",
        "integrator": {"type": "taxel_tracer"},
        "a": {"type": "rectangle", "to_world": tiny, "led": {"type": "annular_led"}},
        "b": {"type": "rectangle", "sensor": {"type": "phototransistor"}},
    }
    with pytest.raises(InputError, match=r"annular_led: 0.25 x 0.25 mm do not fit on its rectangle, 0.1 x 0.1 mm"):
        measure(Scene(scene), points=16)


@pytest.mark.parametrize("missing", ["led", "sensor"])
def test_each_phototransistor_needs_its_led(llvm_mono, missing):
    from mitsuba_taxel import measure

    scene = {
        "type": "scene",
        "integrator": {"type": "taxel_tracer"},
        "a": {"type": "rectangle", "led": {"type": "annular_led"}},
        "b": {"type": "rectangle", "sensor": {"type": "phototransistor"}},
        "c": {"type": "rectangle", "sensor": {"type": "phototransistor", "width": 0.4}},
    }
    if missing == "sensor":
        del scene["b"], scene["c"]
    with pytest.raises(InputError, match="LEDs and .* phototransistors|every sensor must be a phototransistor"):
        measure(Scene(scene), points=16)


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


def test_changed_parameters_need_no_new_kernel(llvm_mono):
    """Numbers are kernel parameters: another force, height or reflectance compiles nothing."""
    import drjit as dr

    from mitsuba_taxel import measure

    def kernels(**values):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            measure(Scene.from_file("plate.xml", **values), points=256, seed=3)
            return [entry for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT]

    gc.collect()  # parts of refused scenes, which other tests have left, would be in the first kernels alone
    kernels(z=0.7, scattering="lambertian")
    again = kernels(z=0.93, hole=0.05, spacing=0.81, width=3, offset_x=0.2, scattering="lambertian")
    assert again and all(entry["cache_hit"] for entry in again)


def test_plugins_leave_the_file_resolver_alone(llvm_mono, monkeypatch):
    """`mi.load_dict` exchanges it, and another thread that makes a `ply` of the same scene then reads freed memory."""

    def refuse(*_, **__):
        raise AssertionError("a plugin called mi.load_dict")

    monkeypatch.setattr(llvm_mono, "load_dict", refuse)
    shapes = f'<shape type="photo_reflector">{BOTH}</shape> <shape type="deformable_pad"/>'
    scene = llvm_mono.load_string(f'<scene version="3.9.0">{shapes}</scene>')
    assert len(scene.shapes()) == 2


def test_interrupting_a_plugin_interrupts_the_load(llvm_mono):
    """Mitsuba turns an interrupt in a plugin's constructor into an error; it must not be taken for bad input."""

    def interrupted(props):
        raise KeyboardInterrupt

    llvm_mono.register_bsdf("interrupted", interrupted)
    with pytest.raises(KeyboardInterrupt):
        Scene({"type": "scene", "plate": {"type": "rectangle", "bsdf": {"type": "interrupted"}}}).load()
