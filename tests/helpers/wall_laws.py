"""Walls of all laws, what they say for given directions, and what they draw."""

from __future__ import annotations

import math

import numpy as np
from kernel_arrays import vectors

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
