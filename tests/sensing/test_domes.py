"""Domes against the sphere that they are: quadrature and rays of our own for unloaded cells, finer cuts for loaded.

The quadrature knows neither elements nor triangles nor a renderer. Its lengths are in mm, heights above the plane of
LED and phototransistor, powers in W per W of an LED that is evenly bright over its square and over the solid angle of
its cone. The side wall and all below absorb.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline
from scipy.special import erf
from scipy.stats import qmc

from mitsuba_taxel import Scene, measure
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.sensing.audit import energy_audit

RADIUS = 1.275  # of the cell
LED, WIDTH, DEPTH = 0.25, 0.52, 0.3
CONE = math.radians(88.0)


def gauss(low, high, count):
    """Nodes and weights of the Gauss-Legendre rule on an interval; ends may be arrays."""
    x, w = np.polynomial.legendre.leggauss(count)
    half = 0.5 * (np.asarray(high) - low)[..., None]
    return np.asarray(low)[..., None] + half * (x + 1), half * w


@dataclass(frozen=True)
class Dome:
    """A cap of the sphere of ``radius`` whose rim, as wide as the cell, is ``rim`` above the LED."""

    radius: float
    rim: float
    spacing: float

    @cached_property
    def centre(self) -> np.ndarray:
        return np.array([0.0, 0.0, self.rim - math.sqrt(self.radius**2 - RADIUS**2)])

    @cached_property
    def widest(self) -> float:
        """Angle between the axis and the rim, seen from the centre."""
        return math.asin(RADIUS / self.radius)

    def at(self, polar, azimuth):
        sine = np.sin(polar)
        place = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar) + 0 * azimuth], axis=-1)
        return self.centre + self.radius * place

    # ---- walls that scatter in all directions

    def diffuse_power(self, law: str, count: int = 36) -> float:
        """With a roof that scatters all light, ``lambertian`` or ``isotropic``."""
        polar, weight = gauss(0.0, self.widest, count)
        azimuth = 2 * math.pi * np.arange(2 * count) / (2 * count)
        weight = np.repeat(weight * np.sin(polar), 2 * count) * self.radius**2 * math.pi / count
        points = self.at(*np.broadcast_arrays(polar[:, None], azimuth)).reshape(-1, 3)
        seen = self._seen_by_detector(points, law)
        if law == "lambertian":  # each part of a sphere lights every other alike
            share = weight / (4 * math.pi * self.radius**2)
            value = seen + share @ seen / (1 - share.sum())
        else:
            value = self._isotropic(points, polar, weight, seen)
        grid = value.reshape(count, -1)
        columns = np.concatenate([azimuth[-8:] - 2 * math.pi, azimuth, azimuth[:8] + 2 * math.pi])
        spline = RectBivariateSpline(polar, columns, np.concatenate([grid[:, -8:], grid, grid[:, :8]], axis=1))
        return self._emitted(spline)

    def _seen_by_detector(self, points, law):
        """Share of what each point scatters that goes straight to the phototransistor."""
        x, wx = gauss(0.5 * self.spacing - 0.5 * WIDTH, 0.5 * self.spacing + 0.5 * WIDTH, 6)
        y, wy = gauss(-0.5 * DEPTH, 0.5 * DEPTH, 6)
        target = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((6, 6))], axis=-1).reshape(-1, 3)
        way = target - points[:, None]
        distance = np.linalg.norm(way, axis=2)
        down = points[:, 2:] / distance
        normal = (self.centre - points) / self.radius
        leaving = np.einsum("pqi,pi->pq", way, normal) / distance / math.pi if law == "lambertian" else 0.5 / math.pi
        return (leaving * down / distance**2) @ np.outer(wx, wy).ravel()

    def _isotropic(self, points, polar, weight, seen):
        """Value of light at each point, seen + integral of value / (4 pi R distance), as cos / r^2 is 1 / (2 R r).

        The kernel's singularity is subtracted: its integral over the cap is known along each direction.
        """
        distance = np.linalg.norm(points[:, None] - points, axis=2)
        np.fill_diagonal(distance, np.inf)
        kernel = weight / (4 * math.pi * self.radius * distance)
        turn, share = gauss(0.0, math.pi, 200)
        a, b = np.cos(polar)[:, None], np.sin(polar)[:, None] * np.cos(turn)
        far = np.arctan2(b, a) + np.arccos(np.clip(math.cos(self.widest) / np.hypot(a, b), -1, 1))
        whole = np.repeat(2 * np.sin(0.5 * far) @ share / (2 * math.pi), len(points) // len(polar))
        rest = whole - kernel.sum(axis=1)
        value = seen
        for _ in range(80):
            value = seen + kernel @ value + rest * value
        return value

    def _emitted(self, value) -> float:
        """Mean of ``value`` over where the LED's light meets the roof."""
        side, w = gauss(-0.5 * LED, 0.5 * LED, 5)
        azimuth = 2 * math.pi * (np.arange(128) + 0.5) / 128
        x, y, phi = (a.ravel() for a in np.meshgrid(side - 0.5 * self.spacing, side, azimuth, indexing="ij"))
        area = np.repeat(np.outer(w, w).ravel() / LED**2, len(azimuth)) / len(azimuth)
        along = x * np.cos(phi) + y * np.sin(phi)
        to_rim = np.sqrt(along**2 + RADIUS**2 - x**2 - y**2) - along
        steepest = np.minimum(np.arctan2(to_rim, self.rim), CONE)
        angle, weight = gauss(0 * steepest, steepest, 40)
        sine, cosine = np.sin(angle), np.cos(angle)
        direction = np.stack([sine * np.cos(phi)[:, None], sine * np.sin(phi)[:, None], cosine], axis=-1)
        start = np.stack([x, y, 0 * x], axis=1)[:, None] - self.centre
        along = (start * direction).sum(axis=2)
        t = np.sqrt(along**2 + self.radius**2 - (start**2).sum(axis=2)) - along
        hit = start + t[..., None] * direction
        polar = np.arccos(np.clip(hit[..., 2] / self.radius, -1, 1))
        arrived = value.ev(polar, np.arctan2(hit[..., 1], hit[..., 0]) % (2 * math.pi))
        return float(area @ (weight * sine * arrived).sum(axis=1) / (1 - math.cos(CONE)))

    # ---- mirrors

    def mirror_power(self, rms_slope: float, points: int = 1 << 16) -> tuple[float, float]:
        """With a mirror for a roof, rough by ``rms_slope`` degrees, by rays; and the standard error, from 16 runs."""
        runs = [self._rays(rms_slope, qmc.Sobol(24, rng=run).random(points)) for run in range(16)]
        return float(np.mean(runs)), float(np.std(runs, ddof=1) / 4)

    def _rays(self, rms_slope, u):
        x = np.stack([LED * (u[:, 0] - 0.5) - 0.5 * self.spacing, LED * (u[:, 1] - 0.5), 0 * u[:, 0]], axis=1)
        cosine = 1 - u[:, 2] * (1 - math.cos(CONE))
        sine, phi = np.sqrt(1 - cosine**2), 2 * math.pi * u[:, 3]
        d = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1)
        count, weight, power = len(u), np.ones(len(u)), 0.0
        alpha = math.sqrt(2) * math.tan(math.radians(rms_slope))
        rng = np.random.default_rng(int(u[0, 0] * 2**32))
        for bounce in range(200):
            start = x - self.centre
            along = (start * d).sum(axis=1)
            t = np.sqrt(np.maximum(along**2 + self.radius**2 - (start**2).sum(axis=1), 0)) - along
            hit = start + t[:, None] * d
            on_roof = hit[:, 2] + self.centre[2] > self.rim
            lost = ~on_roof & (d[:, 2] < 0)
            down = x[lost] - d[lost] * (x[lost, 2] / d[lost, 2])[:, None]
            inside = (np.abs(down[:, 0] - 0.5 * self.spacing) < 0.5 * WIDTH) & (np.abs(down[:, 1]) < 0.5 * DEPTH)
            power += weight[lost] @ inside
            x, d, weight, hit = (value[on_roof] for value in (hit + self.centre, d, weight, hit))
            u = u[on_roof]
            if not len(x):
                break
            normal = -hit / self.radius
            if rms_slope:
                v = u[:, 4 + 2 * bounce : 6 + 2 * bounce] if bounce < 10 else rng.random((len(x), 2))
                d, factor = _from_a_facet(-d, normal, alpha, v)
                weight = weight * factor
            else:
                d = d - 2 * (d * normal).sum(axis=1, keepdims=True) * normal
        return power / count


def _from_a_facet(wi, normal, alpha, v):
    """Direction of reflection at a facet whose normal is drawn after Beckmann's distribution, and its weight."""
    cosine = 1 / np.sqrt(1 - alpha**2 * np.log1p(-v[:, 0]))
    sine, phi = np.sqrt(1 - cosine**2), 2 * math.pi * v[:, 1]
    helper = np.where(np.abs(normal[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    s = np.cross(normal, helper)
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    t = np.cross(normal, s)
    m = (sine * np.cos(phi))[:, None] * s + (sine * np.sin(phi))[:, None] * t + cosine[:, None] * normal
    towards = (wi * m).sum(axis=1)
    wo = 2 * towards[:, None] * m - wi
    before, after = (wi * normal).sum(axis=1), (wo * normal).sum(axis=1)
    factor = np.where((after > 0) & (towards > 0), towards / (before * cosine), 0.0)
    return wo, factor * _visible(before, alpha) * _visible(np.maximum(after, 1e-9), alpha)


def _visible(cosine, alpha):
    """Smith's G1 for Beckmann's distribution."""
    a = cosine / (alpha * np.sqrt(np.maximum(1 - cosine**2, 1e-30)))
    return 2 / (1 + erf(a) + np.exp(-(a**2)) / (a * math.sqrt(math.pi)))


SPACING = 0.6
DOMES = {
    "hemispheric": Dome(1.275, 0.0, SPACING),
    "spherical": Dome(2.55, 1.1 - (2.55 - math.sqrt(2.55**2 - 1.275**2)), SPACING),
}


@cache
def diffuse_truth(cell, law):
    """Power under a dome whose roof scatters all light."""
    return DOMES[cell].diffuse_power(law, 18)


@cache
def mirror_truth(cell, rms_slope=0.0):
    """Power under a dome with a mirror for a roof, and its standard error."""
    return DOMES[cell].mirror_power(rms_slope)


DIFFUSE, MIRROR = 3e-4, 3e-3
"""Relative, what facets may change at the default settings."""


def scene(cell, wall, cells=1, **pad):
    roof = {"type": "region", "roof": {"type": "wall", **wall}}
    reflector = {"type": "photo_reflector", "rows": cells, "columns": cells, "spacing": SPACING}
    reflector |= {"led": {"type": "annular_led", "hole": 0.0}, "detector": {"type": "phototransistor"}}
    pad = {"type": "deformable_pad", "cell": cell, "rows": cells, "columns": cells, "walls": roof, **pad}
    return Scene({"type": "scene", "integrator": {"type": "taxel_tracer"}, "pad": pad, "packages": reflector})


def agrees(readings, truth, truth_error, within):
    """All taxels of an unloaded pad are alike: their mean, within what is allowed and four standard errors."""
    error = readings.replicates.mean(axis=1).std(ddof=1) / math.sqrt(32)
    assert error < 3 * within * truth
    assert abs(readings.power.mean() - truth) < within * truth + 4 * math.hypot(error, truth_error)


def test_the_quadrature_is_right():
    """Against the closed form of an integrating sphere, and converged; isotropic, against rays."""
    dome = DOMES["hemispheric"]
    assert dome.diffuse_power("lambertian") == pytest.approx(0.02955493, rel=1e-6)
    assert dome.diffuse_power("isotropic", 18) == pytest.approx(dome.diffuse_power("isotropic", 24), rel=1e-5)
    assert dome.diffuse_power("isotropic", 18) == pytest.approx(0.021851, abs=3 * 8e-6)


@pytest.mark.parametrize(
    ("cell", "law", "cells"),
    [
        ("hemispheric", "lambertian", 1),
        ("hemispheric", "lambertian", 3),
        ("hemispheric", "isotropic", 1),
        ("spherical", "lambertian", 1),
        ("spherical", "isotropic", 3),
    ],
)
def test_diffuse_domes_read_as_the_sphere(llvm_mono, cell, law, cells):
    points = (1 << 13) // cells
    readings = measure(scene(cell, {"scattering": law}, cells), points=points, seed=4, mechanics_error=False)
    agrees(readings, diffuse_truth(cell, law), 0.0, DIFFUSE)


@pytest.mark.parametrize(
    ("cell", "rms_slope", "cells"),
    [("hemispheric", 0.0, 1), ("hemispheric", 0.0, 3), ("hemispheric", 2.0, 1), ("spherical", 0.0, 1)],
)
def test_mirror_domes_read_as_the_sphere(llvm_mono, cell, rms_slope, cells):
    wall = {"scattering": "rough_mirror", "rms_slope": rms_slope} if rms_slope else {"scattering": "mirror"}
    readings = measure(scene(cell, wall, cells), points=(1 << 13) // cells, seed=4, mechanics_error=False)
    truth, error = mirror_truth(cell, rms_slope)
    agrees(readings, truth, error, MIRROR)


@pytest.mark.parametrize(
    ("cell", "wall", "cut"),
    [
        ("hemispheric", {"scattering": "lambertian"}, {"subdivision": 2}),
        ("hemispheric", {"scattering": "lambertian"}, {"subdivision": 4, "mesh_size": 2.5}),
        ("hemispheric", {"scattering": "isotropic"}, {"subdivision": 2}),
        ("hemispheric", {"scattering": "mirror"}, {"subdivision": 3}),
        ("spherical", {"scattering": "lambertian"}, {"subdivision": 2}),
        ("spherical", {"scattering": "isotropic"}, {"subdivision": 1}),
        ("spherical", {"scattering": "mirror"}, {"subdivision": 3, "mesh_size": 2.5}),
    ],
)
def test_the_stated_error_of_the_geometry_covers_that_against_the_sphere(llvm_mono, cell, wall, cut):
    """Cuts so coarse that it stands out of the noise; two standard deviations, and four of the light."""
    law = wall["scattering"]
    truth, error = mirror_truth(cell) if law == "mirror" else (diffuse_truth(cell, law), 0.0)
    readings = measure(scene(cell, wall, **cut), points=1 << 11, seed=7)
    budget = readings.error_budget
    assert readings.deviation is None and budget["mechanics"] == 0 < budget["geometry"] < 0.02
    assert budget["total"] == pytest.approx(math.hypot(budget["light"], budget["geometry"]))
    noise = math.hypot(readings.standard_error[0], error)
    assert abs(readings.power[0] - truth) < 2 * readings.geometry_error[0] + 4 * noise


def test_a_target_refines_an_unloaded_pad(llvm_mono):
    rough = scene("hemispheric", {"scattering": "lambertian"}, subdivision=2)
    plain, aimed = measure(rough, points=64), measure(rough, target_error=0.002)
    assert plain.error_budget["geometry"] > 0.002 >= aimed.error_budget["total"]
    assert aimed.mesh_size is not None
    truth = DOMES["hemispheric"].diffuse_power("lambertian")
    assert abs(aimed.power[0] - truth) < 3 * aimed.total_error[0]


@pytest.mark.parametrize("cell", ["hemispheric", "spherical", "cylindrical"])
def test_round_mirrors_of_few_triangles_are_refused(llvm_mono, cell):
    """A hemisphere would read 2.5 % too little, and state 0.2 %."""
    walls = {"type": "region", "side": {"type": "wall", "scattering": "mirror"}}
    coarse = scene(cell, {}, subdivision=2)
    coarse.source["pad"]["walls"] = walls
    with pytest.raises(InputError, match="subdivision = 2 is not allowed: the side is a mirror and may be round"):
        coarse.load()


def test_flat_mirrors_may_have_few_triangles(llvm_mono):
    scene("parallelepiped", {"scattering": "mirror"}, subdivision=1).load()
    scene("cylindrical", {"scattering": "mirror"}, subdivision=1).load()


def test_flat_cells_state_no_error_of_the_geometry(llvm_mono):
    readings = measure(scene("parallelepiped", {"scattering": "lambertian"}), points=64)
    assert readings.error_budget["geometry"] == 0 and not readings.facets.any()


@pytest.mark.parametrize("law", ["lambertian", "mirror"])
def test_a_finer_cut_of_a_pressed_dome_reads_the_same(llvm_mono, law):
    """Facets err with the square of their size: of a cut three times as fine by a ninth."""
    points = 1 << 12
    here, fine = (
        measure(scene("hemispheric", {"scattering": law}, force=[0, 0, -2], **cut), points=points, seed=seed)
        for seed, cut in ((1, {}), (2, {"subdivision": 24}))
    )
    noise = math.hypot(here.standard_error[0], fine.standard_error[0])
    assert noise < 1e-3 * fine.power[0]
    within = MIRROR if law == "mirror" else DIFFUSE
    assert abs(here.power[0] - fine.power[0]) < within * fine.power[0] + 4 * noise


@pytest.mark.parametrize(
    "shares", [{"scattering": "mirror"}, {"scattering": "mixed", "specular": 0.5, "isotropic": 0.5}]
)
def test_curved_mirrors_lose_no_light(llvm_mono, shares):
    """Every side of the cell reflects all: light ends on package and board alone, however often it grazes the dome."""
    whole = scene("hemispheric", shares)
    whole.source["pad"]["walls"] = {"type": "wall", **shares}
    whole.source["board"] = {
        "type": "rectangle",
        "to_world": llvm_mono.ScalarTransform4f().scale(5),
        "bsdf": {"type": "wall", "scattering": "absorbing"},
    }
    audit = energy_audit(whole, points=512)
    shares = dict(zip(audit.places, audit.share, strict=True))
    assert audit.total == pytest.approx(1, abs=1e-9)
    kept = sum(share for place, share in shares.items() if "roof" in place or "side" in place or "escaped" in place)
    assert kept < 2e-5, shares
    assert np.isfinite(audit.share).all()
