"""Readings by Mitsuba's own integrators and samplers on the same scene file; each run is one launch."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.evidence.peers.cases import DETECTOR, Estimator, PeerCase, UnsupportedCase


def prepare(case: PeerCase, integrator: str, sampler: str) -> Estimator:
    """Return a function that estimates readings by one of Mitsuba's own integrators: the irradiance of one pixel for
    each phototransistor, times its area. All LEDs are lit.
    """
    import mitsuba as mi

    if integrator == "ptracer" and case.single_bounce:
        raise UnsupportedCase("the path tracer is Mitsuba's own choice here")
    scene = case.load(integrator, sampler)
    mi.set_log_level(mi.LogLevel.Error)  # else `multijitter` reports each count that it rounds up
    taxels = scene.sensors()[0].faces.count

    def estimate(samples: int, seed: int) -> np.ndarray:
        image = mi.render(scene, spp=samples, seed=seed)
        return np.asarray(image, dtype=float)[:, :, 0].reshape(taxels) * DETECTOR[0] * DETECTOR[1]

    return estimate
