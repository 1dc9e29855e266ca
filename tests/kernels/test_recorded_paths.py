"""Readings by recorded kernels are those by traced ones, bit by bit, whatever was changed in between."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from plate_scenes import plate

from mitsuba_taxel import Pad, PadSensor, Scene, Wall, measure
from mitsuba_taxel.kernels.paths.recorded_paths import MOST_SIZES, RecordedPaths, _Recording
from mitsuba_taxel.kernels.surfaces.mesh_adapter import move_vertices, places_of
from mitsuba_taxel.sensing.reading.runs import prepare

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

MIXED = {"scattering": "mixed", "specular": 0.3, "lambertian": 0.3, "isotropic": 0.4, "reflectance": 0.8}
ROUGH = {"scattering": "rough_mirror", "rms_slope": 5.0}
TABLE = "0, 1\n30, 0.9\n80, 0.1\n"


@pytest.fixture(autouse=True)
def on_a_cpu(llvm_mono):
    if not llvm_mono.variant().startswith("llvm"):
        pytest.skip("kernels are recorded on CPUs alone")


def readings(scene, seeds=range(4), points=32):
    return np.array([measure(scene, points=points, seed=seed, mechanics_error=False).replicates for seed in seeds])


def traced(scene, **how):
    import drjit as dr

    with dr.scoped_set_flag(dr.JitFlag.KernelFreezing, False):
        return readings(scene, **how)


def times_recorded(live):
    """For each size of wavefronts."""
    return [each and each.frozen.n_recordings for each in live.sensors()[0].recorded.sizes.values()]


def domed(force):
    sensor = PadSensor(pad=Pad("hemispheric", rows=1, columns=1), force=(0.0, 0.0, force), roof=Wall("isotropic", 0.9))
    return sensor.scene().with_mesh_size(2.0)


def pad_of(live):
    (pad,) = (shape for shape in live.shapes() if hasattr(shape, "state"))
    return pad


def covered(wall, **more):
    """A package under a plate, or among other walls."""
    scene = plate(**more)
    scene.source["plate"]["bsdf"] = {"type": "wall", **wall}
    return scene


def with_tables(folder):
    (folder / "table.csv").write_text(TABLE)
    scene, table = plate(), str(folder / "table.csv")
    scene.source["photo_reflector"]["led"] = {"type": "annular_led", "law": "tabulated", "file": table}
    response = {"response": "tabulated", "file": table}
    scene.source["photo_reflector"]["phototransistor"] = {"type": "phototransistor", **response}
    return scene


SCENES = {
    "mirror": lambda folder: plate(scattering="mirror"),
    "mixed": lambda folder: covered(MIXED, law="lambertian"),
    "rough mirror": lambda folder: covered(ROUGH, law="uniform_polar_angle"),
    "nine taxels": lambda folder: plate(scattering="isotropic", rows=3, columns=3, pitch=3.0),
    "one technique": lambda folder: plate(integrator={"type": "taxel_tracer", "strategy": "connections"}),
    "tables": with_tables,
    "windows": lambda folder: Scene(
        {
            "type": "scene",
            "reflector": {"type": "photo_reflector", "part": "vcnt2020"},
            "plate": plate(z=1.5).source["plate"],
        }
    ),
    "guided": lambda folder: domed(-1.0),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_same_readings(llvm_mono, tmp_path, name):
    """The first wavefront of a size is traced, the second one recorded, and the others repeat that; also of others."""
    live = SCENES[name](tmp_path).load()
    assert np.array_equal(readings(live), traced(live))
    assert np.array_equal(readings(live, points=128), traced(live, points=128))
    assert times_recorded(live) == [1, 1]


def test_what_is_changed_counts(llvm_mono):
    """Power, reflectance and the place of the plate: as a scene that was loaded so, whose first wavefront is traced."""
    live = covered({"reflectance": 0.5}, power=2.0).load()
    before = readings(live)
    parameters = llvm_mono.traverse(live)
    (power,) = (name for name in parameters.keys() if name.endswith("emitter.power"))  # noqa: SIM118
    parameters[power] = 1.0
    parameters["plate.bsdf.reflectance"] = 1.0
    parameters["plate.to_world"] = plate(z=0.9).source["plate"]["to_world"]
    parameters.update()
    for seed in range(3):
        fresh = plate(z=0.9).load()
        assert np.array_equal(readings(live, [seed]), readings(fresh, [seed]))
    assert not np.any(readings(live) == before)


def test_a_guide_that_is_made_anew_counts(llvm_mono):
    """A pad with moved vertices is read like one under that load."""
    ready, other = prepare(domed(-1.0)), prepare(domed(-3.0))
    before = readings(ready)
    move_vertices(pad_of(ready.scene), places_of(pad_of(other.scene)))
    ready.scene.parameters_changed([])
    assert np.array_equal(readings(ready), traced(other))
    assert not np.any(readings(ready) == before)


def test_attributes_of_plugins_count(llvm_mono):
    """Values that tracing depends on, though they are no variables of Dr.Jit, and would change no kernel."""
    live = plate(scattering="lambertian").load()
    readings(live)
    live.integrator().max_depth = 0
    assert not readings(live).any()
    live.integrator().max_depth = -1
    assert np.array_equal(readings(live), traced(live))


def grey_wall(mi):
    """A plugin of a user, whose reflectance is a number of Python's, and which uses a variable where none finds it."""

    import drjit as dr

    hidden = dr.opaque(mi.Float, 1.0)

    class Grey(mi.BSDF):
        def __init__(self, props):
            super().__init__(props)
            self.share = 1.0
            self.m_flags = +mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
            self.m_components = [self.m_flags]

        def sample(self, ctx, si, sample1, sample2, active=True):
            bs = dr.zeros(mi.BSDFSample3f)
            bs.wo = mi.warp.square_to_cosine_hemisphere(sample2)
            bs.pdf = mi.warp.square_to_cosine_hemisphere_pdf(bs.wo)
            bs.eta, bs.sampled_type = 1.0, self.m_flags
            return bs, mi.Spectrum(self.share * hidden) & mi.Bool(active)

        def eval(self, ctx, si, wo, active=True):
            return mi.Spectrum(self.share * hidden * self.pdf(ctx, si, wo, active))

        def pdf(self, ctx, si, wo, active=True):
            return dr.select(active & (si.wi.z > 0) & (wo.z > 0), dr.inv_pi * wo.z, 0)

        def eval_pdf(self, ctx, si, wo, active=True):
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def to_string(self):
            return "Grey[]"

    mi.register_bsdf("grey", Grey)
    return {"type": "grey"}


def test_foreign_walls_are_traced_each_time(llvm_mono):
    scene = plate()
    scene.source["plate"]["bsdf"] = grey_wall(llvm_mono)
    live = scene.load()
    white = readings(live)
    live.shapes()[1].bsdf().share = 0.5
    np.testing.assert_allclose(readings(live), 0.5 * white, rtol=1e-5)
    assert times_recorded(live) == []


def test_foreign_walls_of_other_scenes_are_no_harm(llvm_mono):
    """They are in the kernels of every scene, which thus cannot be recorded."""
    live, other = plate().load(), plate()
    alone = traced(live)
    other.source["plate"]["bsdf"] = grey_wall(llvm_mono)
    other = other.load()
    assert np.array_equal(readings(live), alone)
    assert times_recorded(live) == [None]
    del other


def test_an_interrupt_while_paths_are_recorded_is_one(llvm_mono, monkeypatch):
    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(_Recording, "_traced", interrupted)
    live = plate(scattering="isotropic").load()
    readings(live, [0])
    with pytest.raises(KeyboardInterrupt):
        readings(live, [1])


def test_few_sizes_are_kept_and_no_scene(llvm_mono):
    live = plate().load()
    for exponent in range(MOST_SIZES + 2):
        readings(live, seeds=(0, 1), points=1 << exponent)
    sizes = live.sensors()[0].recorded.sizes
    assert [points for _, points in sizes] == [1 << exponent for exponent in range(2, MOST_SIZES + 2)]
    gc.collect()
    kept = _count()
    del live, sizes
    assert _count() == kept - 1  # at once, not when garbage is collected


def _count() -> int:
    return sum(isinstance(each, RecordedPaths) for each in gc.get_objects())
