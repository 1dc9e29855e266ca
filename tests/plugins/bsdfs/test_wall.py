"""The wall: what it samples against what it says, against closed forms, and against Mitsuba's own rough conductor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from chi_square import SIGNIFICANCE, chi2
from kernel_arrays import vectors

from mitsuba_taxel import InputError, Scene, measure

REFLECTANCE = 0.7
LAWS = {
    "lambertian": {"scattering": "lambertian"},
    "isotropic": {"scattering": "isotropic"},
    "mixed": {"scattering": "mixed", "specular": 0.2, "lambertian": 0.3, "isotropic": 0.5},
    "rough": {"scattering": "rough_mirror", "rms_slope": 20.0},
    "rougher": {"scattering": "rough_mirror", "rms_slope": 45.0},
}
MODES = ("Importance", "Radiance")
SMOOTH_SHARE = {"mixed": 0.8}


def wall(mi, law, **parameters):
    return mi.load_dict({"type": "wall", "reflectance": REFLECTANCE, **LAWS[law], **parameters})


def context(mi, mode):
    return mi.BSDFContext(getattr(mi.TransportMode, mode))


def direction(angle, azimuth=30.0, side=1):
    """(3,) unit vector at an angle in degrees from the normal."""
    theta, phi = math.radians(angle), math.radians(azimuth)
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), side * math.cos(theta)])


def directions(count, seed=0):
    """(count, 3) unit vectors, uniform over the upper hemisphere."""
    z, phi = np.random.default_rng(seed).uniform(size=(2, count)) * [[1], [2 * np.pi]]
    return np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z], axis=1)


def interaction(mi, wi):
    import drjit as dr

    wi = vectors(mi, *np.atleast_2d(wi).T)
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(wi))
    si.wi = wi
    si.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
    return si


def evaluate(mi, bsdf, mode, wi, wo):
    """(n,) values f |cos(theta_o)| and (n,) densities, in double precision."""
    value, density = bsdf.eval_pdf(context(mi, mode), interaction(mi, wi), vectors(mi, *np.atleast_2d(wo).T))
    return value[0].numpy().astype(float), density.numpy().astype(float)


def draw(mi, bsdf, mode, wi, count=100_000, seed=0):
    """A sample and its weights (n,), for one direction of incidence."""
    rng = mi.PCG32(size=count, initstate=seed)
    sample1, sample2 = rng.next_float32(), mi.Point2f(rng.next_float32(), rng.next_float32())
    bs, weight = bsdf.sample(context(mi, mode), interaction(mi, np.tile(wi, (count, 1))), sample1, sample2)
    return bs, weight[0].numpy().astype(float)


def as_array(vector):
    return np.stack([component.numpy().astype(float) for component in vector], axis=1)


def hemisphere(n=400, azimuths=400):
    """Directions (n * azimuths, 3) and weights that integrate over the upper hemisphere."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    theta = 0.25 * np.pi * (nodes + 1)
    phi = 2 * np.pi * (np.arange(azimuths) + 0.5) / azimuths
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    wo = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    weight = np.outer(0.25 * np.pi * weights, np.full(azimuths, 2 * np.pi / azimuths)) * np.sin(theta)
    return wo.reshape(-1, 3), weight.ravel()


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("angle", [15.0, 75.0, 89.9])
def test_directions_follow_the_density(llvm_mono, law, mode, side, angle):
    """Chi-square test of the smooth part; a mirror's part is left out by the first random number."""
    import drjit as dr
    from mitsuba.chi2 import SphericalDomain

    mi = llvm_mono
    bsdf, ctx = wall(mi, law), context(mi, mode)
    wi, smooth = direction(angle, side=side), SMOOTH_SHARE.get(law, 1)

    def sample(numbers):
        si = interaction(mi, np.tile(wi, (dr.width(numbers), 1)))
        bs, weight = bsdf.sample(ctx, si, 1 - smooth * numbers.x, mi.Point2f(numbers.y, numbers.z))
        return bs.wo, dr.select(weight[0] > 0, mi.Float(1), 0)

    def density(wo):
        return bsdf.pdf(ctx, interaction(mi, np.tile(wi, (dr.width(wo), 1))), wo) / smooth

    chi2(SphericalDomain(), sample, density, dimensions=3, resolution=21, inner=64)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("angle", [0.0, 75.0, 89.9])
def test_weight_is_value_over_density(llvm_mono, law, mode, side, angle):
    mi = llvm_mono
    bsdf, wi = wall(mi, law), direction(angle, side=side)
    bs, weight = draw(mi, bsdf, mode, wi, 20_000)
    value, density = evaluate(mi, bsdf, mode, np.tile(wi, (len(weight), 1)), as_array(bs.wo))
    smooth = ~np.asarray(mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)) & (weight > 0)
    # The facet of a rough mirror follows from the rounded directions less exactly than it was drawn.
    loose = 2e-2 if law.startswith("rough") and angle > 89 else 1e-3
    assert np.allclose(density[smooth], bs.pdf.numpy()[smooth], rtol=loose)
    assert np.allclose(weight[smooth] * density[smooth], value[smooth], rtol=loose)
    assert np.all(as_array(bs.wo)[weight > 0, 2] * side > 0)
    if mode == "Importance":
        assert weight.max() <= REFLECTANCE * (1 + 1e-6)


def test_mixed_draws_its_mirror_as_often_as_its_share_says(llvm_mono):
    from scipy import stats

    mi = llvm_mono
    wi = direction(40)
    for mode in MODES:
        bs, weight = draw(mi, wall(mi, "mixed"), mode, wi)
        mirrored = np.asarray(mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta))
        assert stats.binomtest(int(mirrored.sum()), mirrored.size, 0.2).pvalue > SIGNIFICANCE
        assert np.array_equal(bs.sampled_component.numpy(), np.where(mirrored, 0, 1))
        assert np.allclose(as_array(bs.wo)[mirrored], wi * [-1, -1, 1], atol=1e-6)
        assert np.allclose(weight[mirrored], REFLECTANCE) and np.allclose(bs.pdf.numpy()[mirrored], 0.2)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("angle", [0.0, 40.0, 75.0, 89.9])
def test_light_reflected_is_the_reflectance(llvm_mono, agree, law, angle):
    """By quadrature; a rough mirror loses what meets a second facet, as much as its samples say."""
    mi = llvm_mono
    bsdf, wi = wall(mi, law), direction(angle)
    wo, weights = hemisphere()
    albedo = weights @ evaluate(mi, bsdf, "Importance", np.tile(wi, (len(wo), 1)), wo)[0]
    if not law.startswith("rough"):
        assert albedo == pytest.approx(REFLECTANCE * SMOOTH_SHARE.get(law, 1), rel=1e-5)
        return
    _, weight = draw(mi, bsdf, "Importance", wi, 1 << 18)
    groups = weight.reshape(32, -1).mean(axis=1)
    agree(groups.mean(), groups.std(ddof=1) / math.sqrt(32), albedo)
    assert albedo < REFLECTANCE


@pytest.mark.parametrize("law", ["lambertian", "rough", "rougher"])
def test_reciprocity(llvm_mono, law):
    mi = llvm_mono
    bsdf, wi, wo = wall(mi, law), directions(2000, 1), directions(2000, 2)
    for mode in MODES:
        forward = evaluate(mi, bsdf, mode, wi, wo)[0] / wo[:, 2]
        backward = evaluate(mi, bsdf, mode, wo, wi)[0] / wi[:, 2]
        assert np.allclose(forward, backward, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("law", LAWS)
def test_transport_modes_are_adjoint(llvm_mono, law):
    """What light carries from wi to wo, a detector sees from wo to wi."""
    mi = llvm_mono
    bsdf, wi, wo = wall(mi, law), directions(2000, 3), directions(2000, 4)
    from_light = evaluate(mi, bsdf, "Importance", wi, wo)[0] / wo[:, 2]
    from_detector = evaluate(mi, bsdf, "Radiance", wo, wi)[0] / wi[:, 2]
    assert np.allclose(from_light, from_detector, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("mode", MODES)
def test_mixed_is_the_weighted_sum_of_its_parts(llvm_mono, mode):
    mi = llvm_mono
    wi, wo = directions(1000, 5), directions(1000, 6)
    mixed = evaluate(mi, wall(mi, "mixed"), mode, wi, wo)
    parts = [evaluate(mi, wall(mi, law), mode, wi, wo) for law in ("lambertian", "isotropic")]
    for i in (0, 1):
        assert np.allclose(mixed[i], 0.3 * parts[0][i] + 0.5 * parts[1][i], rtol=1e-5)


@pytest.mark.parametrize("only", ["specular", "lambertian", "isotropic"])
@pytest.mark.parametrize("mode", MODES)
def test_a_mixed_wall_of_one_part_is_that_part(llvm_mono, mode, only):
    mi = llvm_mono
    mixed = mi.load_dict({"type": "wall", "scattering": "mixed", only: 1.0})
    alone = mi.load_dict({"type": "wall", "scattering": "mirror" if only == "specular" else only})
    wi, wo = directions(1000, 7), directions(1000, 8)
    for mine, other in zip(evaluate(mi, mixed, mode, wi, wo), evaluate(mi, alone, mode, wi, wo), strict=True):
        assert np.allclose(mine, other, rtol=1e-6)
    mine, other = (draw(mi, bsdf, mode, direction(60)) for bsdf in (mixed, alone))
    assert np.allclose(as_array(mine[0].wo), as_array(other[0].wo)) and np.allclose(mine[1], other[1], rtol=1e-5)


def beckmann(wi, wo, alpha):
    """f cos(theta_o) of a rough perfect conductor, in double precision: Walter et al. 2007, with Smith's G1 exactly."""
    from scipy.special import erf

    def visible(v):
        a = v[:, 2] / (alpha * np.maximum(np.hypot(v[:, 0], v[:, 1]), 1e-12))
        shadow = 0.5 * (np.exp(-(a**2)) / (a * np.sqrt(np.pi)) - (1 - erf(a)))
        return 1 / (1 + shadow)

    half = wi + wo
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    tan2 = (half[:, 0] ** 2 + half[:, 1] ** 2) / half[:, 2] ** 2
    facets = np.exp(-tan2 / alpha**2) / (np.pi * alpha**2 * half[:, 2] ** 4)
    return facets * visible(wi) * visible(wo) / (4 * wi[:, 2])


@pytest.mark.parametrize("slope", [0.1, 5.0, 20.0, 45.0])
def test_rough_mirror_is_beckmann_and_smith(llvm_mono, slope):
    """Against the formulas in double precision, and against Mitsuba's conductor, whose G1 is a fit to 0.35 %."""
    mi = llvm_mono
    alpha = math.sqrt(2) * math.tan(math.radians(slope))
    tilt = np.random.default_rng(9).normal(size=(5000, 2)) * alpha / math.sqrt(2)
    facet = np.concatenate([-tilt, np.ones((5000, 1))], axis=1)
    facet /= np.linalg.norm(facet, axis=1, keepdims=True)
    wi = directions(5000, 10)
    wo = 2 * np.sum(wi * facet, axis=1, keepdims=True) * facet - wi
    seen = (wo[:, 2] > 0.02) & (wi[:, 2] > 0.02)
    wi, wo = wi[seen], wo[seen]
    assert len(wi) > 1000
    ours = evaluate(mi, wall(mi, "rough", rms_slope=slope, reflectance=1.0), "Importance", wi, wo)[0]
    assert np.allclose(ours, beckmann(wi, wo, alpha), rtol=2e-2 if slope < 1 else 1e-3)
    conductor = {"type": "roughconductor", "material": "none", "distribution": "beckmann", "alpha": alpha}
    theirs = mi.load_dict(conductor)
    assert np.allclose(ours, evaluate(mi, theirs, "Importance", wi, wo)[0], rtol=8e-3)


@pytest.mark.parametrize("slope", [0.01, 1.0, 20.0, 45.0])
def test_facets_project_to_the_area_of_the_wall(llvm_mono, slope):
    """The integral of D cos over the hemisphere is 1; in slopes, over which it is smooth however small they are."""
    mi = llvm_mono
    normals = wall(mi, "rough", rms_slope=slope).law._normals()
    alpha = math.sqrt(2) * math.tan(math.radians(slope))
    nodes, weights = np.polynomial.legendre.leggauss(200)
    x, y = np.meshgrid(8 * alpha * nodes, 8 * alpha * nodes)
    normal = np.stack([-x.ravel(), -y.ravel(), np.ones(x.size)], axis=1)
    cosine = 1 / np.linalg.norm(normal, axis=1)
    d = normals.eval(vectors(mi, *(normal * cosine[:, None]).T)).numpy().astype(float)
    total = (np.outer(weights, weights).ravel() * (8 * alpha) ** 2) @ (d * cosine * cosine**3)
    assert total == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("slope", [0.01, 0.1, 1.0, 5.0])
def test_slopes_of_the_facets_have_the_given_root_mean_square(llvm_mono, slope):
    """At normal incidence: along x and along y, the sum of squares follows the chi-square distribution."""
    from scipy import stats

    mi = llvm_mono
    count = 200_000
    bs, weight = draw(mi, wall(mi, "rough", rms_slope=slope), "Importance", np.array([0, 0, 1.0]), count)
    wo = as_array(bs.wo)
    assert np.all(weight > 0)
    slopes = wo[:, :2] / (1 + wo[:, 2:])
    for axis in (0, 1):
        total = np.sum((slopes[:, axis] / math.tan(math.radians(slope))) ** 2)
        assert SIGNIFICANCE / 2 < stats.chi2.cdf(total, count) < 1 - SIGNIFICANCE / 2


@pytest.mark.parametrize("angle", [0.0, 60.0, 89.0])
def test_the_smallest_slope_is_a_mirror_nearly(llvm_mono, angle):
    """In single precision too: the mean direction is the mirror's, all light comes back, also by the stated values."""
    mi = llvm_mono
    slope, wi = 0.01, direction(angle)
    bsdf = wall(mi, "rough", rms_slope=slope, reflectance=1.0)
    bs, weight = draw(mi, bsdf, "Importance", wi)
    wo = as_array(bs.wo)
    spread = 5 * 2 * math.tan(math.radians(slope))
    assert np.allclose(wo.mean(axis=0), wi * [-1, -1, 1], atol=spread / math.sqrt(len(wo)) + 1e-6)
    assert np.allclose(weight, 1, atol=1e-3)
    value, _ = evaluate(mi, bsdf, "Importance", np.tile(wi, (len(wo), 1)), wo)
    reference = beckmann(np.tile(wi, (len(wo), 1)), wo, math.sqrt(2) * math.tan(math.radians(slope)))
    assert np.mean(value / reference) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("mode", MODES)
def test_everything_is_finite_at_grazing(llvm_mono, mode):
    mi = llvm_mono
    cosines = np.array([0.0, 1e-7, 1e-4, 1.0])
    edge = np.stack([np.sqrt(1 - cosines**2), 0 * cosines, cosines], axis=1)
    wi, wo = np.repeat(edge, 8, axis=0), np.tile(np.concatenate([edge, edge * [-1, 1, 1]]), (4, 1))
    walls = [{"scattering": name} for name in ("mirror", "absorbing")] + list(LAWS.values())
    walls += [{"scattering": "mixed", name: 1.0} for name in ("specular", "lambertian", "isotropic")]
    walls += [{"scattering": "rough_mirror", "rms_slope": slope} for slope in (0.01, 1.0)]
    for parameters in walls:
        bsdf = mi.load_dict({"type": "wall", **parameters})
        for sign in (1, -1):
            value, density = evaluate(mi, bsdf, mode, wi * [1, 1, sign], wo * [1, 1, sign])
            assert np.all(np.isfinite(value)) and np.all(np.isfinite(density)), parameters
            assert np.all(value[(wi[:, 2] == 0) | (wo[:, 2] == 0)] == 0)
            for numbers in (0.0, 0.3, 1 - 2**-24):
                bs, weight = bsdf.sample(
                    context(mi, mode), interaction(mi, edge * [1, 1, sign]), mi.Float(numbers), mi.Point2f(numbers)
                )
                for result in (*bs.wo, bs.pdf, weight[0]):
                    assert np.all(np.isfinite(result.numpy())), (parameters, numbers)
                assert weight[0].numpy()[0] == 0


@pytest.mark.parametrize(
    "parameters, share",
    [
        ({"scattering": "mirror"}, 0),
        ({"scattering": "lambertian"}, 1),
        ({"scattering": "isotropic"}, 1),
        ({"scattering": "rough_mirror", "rms_slope": 5.0}, 1),
        ({"scattering": "mixed", "specular": 0.4, "lambertian": 0.35, "isotropic": 0.25}, 0.6),
        ({"scattering": "absorbing"}, 0),
    ],
)
def test_diffuse_reflectance_is_that_without_mirrors(llvm_mono, parameters, share):
    """Asked directly and, as integrators do, through the pointers that a ray finds, also by region."""
    mi = llvm_mono
    reflectance = {} if parameters["scattering"] == "absorbing" else {"reflectance": 0.5}
    bsdf = {"type": "wall", **parameters, **reflectance}
    answer = mi.load_dict(bsdf).eval_diffuse_reflectance(interaction(mi, direction(30)))
    assert np.allclose(answer.numpy(), 0.5 * share)
    reflector = {"type": "photo_reflector", "led": {"type": "annular_led"}, "sensor": {"type": "phototransistor"}}
    scene = mi.load_dict(
        {
            "type": "scene",
            "plate": {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([5, 0, 0]), "bsdf": bsdf},
            "other": {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([9, 0, 0])},
            "package": {**reflector, "bsdf": {"type": "region", "body": bsdf}},
        }
    )
    above = mi.Point3f([5, 0, -0.45, 0.45], [0, 0.5, 0, 0], 2)  # the plate, the body, the LED, the phototransistor
    si = scene.ray_intersect(mi.Ray3f(above, mi.Vector3f(0, 0, -1)))
    assert np.all(si.is_valid().numpy())
    answer = si.bsdf().eval_diffuse_reflectance(si)
    assert np.allclose(answer[0].numpy(), [0.5 * share, 0.5 * share, 0, 0])


def plate(bsdf, integrator=None, height=0.7):
    """A photo-reflector under a plate with a wall."""
    import mitsuba as mi

    return Scene(
        {
            "type": "scene",
            "integrator": integrator or {"type": "taxel_tracer"},
            "package": {
                "type": "photo_reflector",
                "led": {"type": "annular_led", "law": "lambertian"},
                "sensor": {"type": "phototransistor"},
            },
            "plate": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().translate([0, 0, 0.5 + height]).scale(2),
                "bsdf": {"type": "wall", **bsdf},
            },
        }
    )


@pytest.mark.parametrize("law", ["mixed", "rough"])
def test_all_ways_to_trace_agree(llvm_mono, agree, law):
    """Connections, hits, both, and `path` from the detector; only hits and both see a mirror's share."""
    ours = measure(plate(LAWS[law]), points=1 << 14, seed=1)
    strategies = ("unidirectional_hits",) if law == "mixed" else ("unidirectional_hits", "connections")
    integrators = [{"type": "taxel_tracer", "strategy": strategy} for strategy in strategies] + [{"type": "path"}]
    for seed, integrator in enumerate(integrators, 2):
        points = 1 << 11 if integrator["type"] == "path" else 1 << 14
        theirs = measure(plate(LAWS[law], integrator), points=points, seed=seed)
        agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


def test_changed_numbers_need_no_new_kernel(llvm_mono, table):
    """Shares, slope, reflectance and wavelength are kernel parameters, shares of zero included."""
    import drjit as dr

    def kernels(wavelength=None, **bsdf):
        live = plate(bsdf).load()
        if wavelength:
            live.shapes()[1].bsdf().set_wavelength(wavelength)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            measure(live, points=256)
            return [entry for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT]

    mixed = {"scattering": "mixed"}
    kernels(**mixed, specular=0.2, lambertian=0.3, isotropic=0.5)
    again = kernels(**mixed, specular=0.0, lambertian=0.25, isotropic=0.75, reflectance=0.4)
    again += kernels(**mixed, lambertian=1.0, reflectance_table=table, wavelength=905.0)
    rough = {"scattering": "rough_mirror"}
    kernels(**rough, rms_slope=3.0)
    again += kernels(**rough, rms_slope=0.5, reflectance=0.3)
    assert again and all(entry["cache_hit"] for entry in again)


@pytest.fixture
def table(tmp_path):
    """A file with the reflectances of a wall that gets darker, with all that a table may hold besides."""
    path = tmp_path / "paint.csv"
    path.write_text("# nm, reflectance\n900, 0.8\n\n925, 0.7  # measured\n1000, 0.1\n")
    return str(path)


@pytest.mark.parametrize("nm, reflectance", [(900, 0.8), (905, 0.78), (925, 0.7), (950, 0.5), (1000, 0.1)])
def test_table_is_interpolated(llvm_mono, table, nm, reflectance):
    mi = llvm_mono
    bsdf = mi.load_dict({"type": "wall", "reflectance_table": table})
    assert bsdf.needs_wavelength and "not known yet" in str(bsdf)
    bsdf.set_wavelength(nm)
    assert draw(mi, bsdf, "Importance", direction(20), 4)[1] == pytest.approx(reflectance)
    assert bsdf.needs_wavelength


def test_table_is_found_beside_the_scene(llvm_mono, table, tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(
        '<scene version="3.9.0"> <shape type="sphere"> <bsdf type="wall">'
        '<string name="reflectance_table" value="paint.csv"/> </bsdf> </shape> </scene>'
    )
    assert Scene.from_file(path).load().shapes()[0].bsdf().needs_wavelength


def test_a_wall_with_a_table_waits_for_the_wavelength(llvm_mono, table):
    mi = llvm_mono
    bsdf = mi.load_dict({"type": "wall", "reflectance_table": table})
    ctx, si, wo = context(mi, "Importance"), interaction(mi, direction(20)), mi.Vector3f(0, 0, 1)
    for call in (
        lambda: bsdf.sample(ctx, si, 0.5, mi.Point2f(0.5)),
        lambda: bsdf.eval(ctx, si, wo),
        lambda: bsdf.pdf(ctx, si, wo),
        lambda: bsdf.eval_pdf(ctx, si, wo),
        lambda: bsdf.eval_diffuse_reflectance(si),
    ):
        with pytest.raises(InputError, match="reflectance_table needs the wavelength .* through mitsuba_taxel"):
            call()
    with pytest.raises(InputError, match=r"paint.csv' has no .* wavelength of 850 nm: it holds 900 to 1000 nm"):
        bsdf.set_wavelength(850.0)
    with pytest.raises(InputError, match="wavelength of nan nm"):
        bsdf.set_wavelength(float("nan"))


def test_region_passes_the_wavelength_on(llvm_mono, table):
    mi = llvm_mono
    tabulated, plain = {"type": "wall", "reflectance_table": table}, {"type": "wall", "reflectance": 0.3}
    stock = {"type": "diffuse"}
    assert not mi.load_dict({"type": "region", "roof": plain, "side": stock}).needs_wavelength
    region = mi.load_dict({"type": "region", "roof": tabulated, "side": plain, "bottom": stock, "led": tabulated})
    assert region.needs_wavelength and not region.walls["side"].needs_wavelength
    region.set_wavelength(950)
    assert region.walls["roof"].reflectance[0] == region.walls["led"].reflectance[0] == pytest.approx(0.5)
    assert region.walls["side"].reflectance[0] == pytest.approx(0.3)


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "0 rows"),
        ("900, 0.5, 1\n", "3 columns"),
        ("nm, reflectance\n900, 0.5\n", "two columns of numbers are needed"),
        ("900, 0.5\n900, 0.6\n", "row 2, 900, 0.6, is not allowed"),
        ("900, 1.5\n", "row 1, 900, 1.5, is not allowed"),
        ("900, nan\n", "row 1, 900, nan, is not allowed"),
        ("900, 0.5\ninf, 0.5\n", "row 2, inf, 0.5, is not allowed"),
        ("-900, 0.5\n", "row 1, -900, 0.5, is not allowed"),
    ],
)
def test_bad_tables_are_refused(llvm_mono, tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    scene = Scene({"type": "scene", "s": {"type": "sphere", "b": {"type": "wall", "reflectance_table": str(path)}}})
    with pytest.raises(InputError, match=message) as caught:
        scene.load()
    assert "\n" not in str(caught.value) and "reflectance_table" in str(caught.value)


def test_the_smallest_slope_may_be_given_in_a_file(llvm_mono, tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(
        '<scene version="3.9.0"> <bsdf type="wall"> <string name="scattering" value="rough_mirror"/>'
        '<float name="rms_slope" value="0.01"/> </bsdf> </scene>'
    )
    Scene.from_file(path).load()


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic"])
def test_wall_transport_modes_are_adjoint(llvm_mono, scattering):
    """f(wi -> wo) seen from the light equals f(wo -> wi) seen from the detector, cosines apart."""
    import drjit as dr

    mi = llvm_mono
    bsdf, light, detector = wall(mi, scattering), *(context(mi, mode) for mode in MODES)
    rng = mi.PCG32(size=1000)
    directions = [
        mi.warp.square_to_uniform_hemisphere(mi.Point2f(rng.next_float32(), rng.next_float32())) for _ in range(2)
    ]
    forward, backward = dr.zeros(mi.SurfaceInteraction3f, 1000), dr.zeros(mi.SurfaceInteraction3f, 1000)
    forward.wi, backward.wi = directions
    from_light = bsdf.eval(light, forward, directions[1])[0] / directions[1].z
    from_detector = bsdf.eval(detector, backward, directions[0])[0] / directions[0].z
    assert from_light.numpy() == pytest.approx(from_detector.numpy(), rel=1e-4)


@pytest.mark.parametrize(
    "scattering, albedo", [("lambertian", 0.7), ("isotropic", 0.7), ("mirror", 0.7), ("absorbing", 0)]
)
def test_wall_reflects_its_reflectance(llvm_mono, scattering, albedo):
    import drjit as dr

    mi = llvm_mono
    parameters = {} if scattering == "absorbing" else {"reflectance": albedo}
    bsdf = mi.load_dict({"type": "wall", "scattering": scattering, **parameters})
    si = dr.zeros(mi.SurfaceInteraction3f, 1000)
    si.wi = dr.normalize(mi.Vector3f(0.5, 0.1, 0.3))
    rng = mi.PCG32(size=1000)
    _, weight = bsdf.sample(
        mi.BSDFContext(mi.TransportMode.Importance),
        si,
        0.5,
        mi.Point2f(rng.next_float32(), rng.next_float32()),
    )
    assert np.allclose(weight[0].numpy(), albedo)
