"""Readings by the integrators of this package, by `measure` on a loaded scene."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.evidence.peers.cases import Estimator, PeerCase, UnsupportedCase

INTEGRATORS = ("taxel_tracer", "taxel_path", "analog_tracer")


def prepare(case: PeerCase, integrator: str) -> Estimator:
    """Return a function that estimates readings by an integrator of this package. A run is one call of `measure`; the
    samples are divided among its randomisations.
    """
    from mitsuba_taxel import InputError, measure
    from mitsuba_taxel.backend import plugin_files
    from mitsuba_taxel.sensing.reading.runs import REPLICATES

    if integrator not in plugin_files():
        raise UnsupportedCase("no plugin of this name is registered")
    scene = case.load(integrator)
    try:
        measure(scene, points=1)
    except InputError as reason:
        raise UnsupportedCase(str(reason)) from reason

    def estimate(samples: int, seed: int) -> np.ndarray:
        return measure(scene, points=max(1, samples // REPLICATES), seed=seed).power

    return estimate
