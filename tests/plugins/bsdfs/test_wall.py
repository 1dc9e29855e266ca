"""The wall: what it samples against what it says, and against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from chi_square import SIGNIFICANCE, chi2
from kernel_arrays import vectors
from wall_laws import (
    LAWS,
    MODES,
    REFLECTANCE,
    SMOOTH_SHARE,
    as_array,
    context,
    direction,
    directions,
    draw,
    evaluate,
    hemisphere,
    interaction,
    wall,
)

from mitsuba_taxel import Scene, measure


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
    assert np.allclose(from_light, from_detector, rtol=1e-3 if law.startswith("rough") else 1e-4, atol=1e-6)


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


def test_changed_numbers_need_no_new_kernel(llvm_mono, tmp_path):
    """Shares, slope, reflectance and wavelength are kernel parameters, shares of zero included."""
    import drjit as dr

    table = tmp_path / "paint.csv"
    table.write_text("900, 0.8\n925, 0.7\n")

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
    again += kernels(**mixed, lambertian=1.0, reflectance_table=str(table), wavelength=905.0)
    rough = {"scattering": "rough_mirror"}
    kernels(**rough, rms_slope=3.0)
    again += kernels(**rough, rms_slope=0.5, reflectance=0.3)
    assert again and all(entry["cache_hit"] for entry in again)


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


# Triangles with interpolated normals: the wall's normal is along z, the triangle's is tilted against it. Light that
# would leave behind the triangle is mirrored by it, an isometry.

DIRECTED = [law for law in LAWS if law in ("mixed", "rough", "rougher")]
NORMALS = [direction(25.0, azimuth) for azimuth in (40.0, 160.0, 290.0)]
"""The first towards the light, the others away from it."""
WI = direction(60.0)


def tilted(mi, wi, normal):
    """Light from directions ``wi`` on a triangle with that normal."""
    si = interaction(mi, wi)
    si.n = mi.Normal3f(*vectors(mi, *normal))
    return si


def mirrored(directions, normal):
    return directions - 2 * (directions @ normal)[..., None] * normal


def along(normal):
    """(3, 3) turn that takes z to a unit vector."""
    axis = np.cross([0, 0, 1], normal)
    cross = np.cross(np.eye(3), axis)
    return np.eye(3) + cross + cross @ cross / (1 + normal[2])


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("normal", NORMALS)
def test_a_mirror_reflects_twice_where_once_leads_behind(llvm_mono, normal, side):
    mi = llvm_mono
    wi = np.stack([side * direction(angle, azimuth) for angle in (5, 30, 60, 80) for azimuth in (30, 110, 200, 290)])
    wi = wi[side * (wi @ normal) > 0]
    bsdf, ctx = mi.load_dict({"type": "wall", "scattering": "mirror"}), context(mi, "Importance")
    bs, weight = bsdf.sample(ctx, tilted(mi, wi, normal), mi.Float(0.5), mi.Point2f(0.5))
    once = wi * [-1, -1, 1]
    behind = side * (once @ normal) < 0
    assert np.any(behind) and not np.all(behind)
    expected = np.where(behind[:, None], mirrored(once, normal), once)
    assert np.allclose(as_array(bs.wo), expected, atol=1e-6)
    assert np.allclose(weight[0].numpy(), 1)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("law", DIRECTED)
@pytest.mark.parametrize("normal", NORMALS)
def test_as_much_is_reflected_as_by_an_even_wall_and_nothing_behind(llvm_mono, law, mode, normal):
    mi = llvm_mono
    bsdf, ctx = wall(mi, law), context(mi, mode)
    wo, weights = hemisphere()

    def integrals(wo, si):
        value, density = bsdf.eval_pdf(ctx, si, vectors(mi, *wo.T))
        return np.array([weights @ value[0].numpy().astype(float), weights @ density.numpy().astype(float)])

    before = np.tile(WI, (len(wo), 1))
    even, front = integrals(wo, interaction(mi, before)), integrals(wo @ along(normal).T, tilted(mi, before, normal))
    assert np.allclose(front, even, rtol=3e-3)
    assert np.all(integrals(-wo @ along(normal).T, tilted(mi, before, normal)) == 0)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("law", DIRECTED)
@pytest.mark.parametrize("normal", NORMALS[1:])
def test_directions_follow_the_density_there(llvm_mono, law, mode, normal, side):
    """Chi-square test; and the weight is the value over the density."""
    import drjit as dr
    from mitsuba.chi2 import SphericalDomain

    mi = llvm_mono
    bsdf, ctx, smooth = wall(mi, law), context(mi, mode), SMOOTH_SHARE.get(law, 1)

    def at(width):
        return tilted(mi, np.tile(side * WI, (width, 1)), normal)

    def sample(numbers):
        si = at(dr.width(numbers))
        bs, weight = bsdf.sample(ctx, si, 1 - smooth * numbers.x, mi.Point2f(numbers.y, numbers.z))
        return bs.wo, dr.select(weight[0] > 0, mi.Float(1), 0)

    def density(wo):
        return bsdf.pdf(ctx, at(dr.width(wo)), wo) / smooth

    chi2(SphericalDomain(), sample, density, dimensions=3, resolution=21, inner=64)
    rng = mi.PCG32(size=5000, initstate=1)
    numbers = mi.Point2f(rng.next_float32(), rng.next_float32())
    bs, weight = bsdf.sample(ctx, at(5000), 1 - smooth * rng.next_float32(), numbers)
    value, density = bsdf.eval_pdf(ctx, at(5000), bs.wo)
    drawn = weight[0].numpy() > 0
    assert np.allclose((weight[0] * density).numpy()[drawn], value[0].numpy()[drawn], rtol=1e-3)
    assert np.all(side * (as_array(bs.wo)[drawn] @ normal) > 0)
