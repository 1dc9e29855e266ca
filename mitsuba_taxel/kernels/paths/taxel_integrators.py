"""Predicates that identify the integrators of this package."""

from __future__ import annotations

from typing import Protocol, TypeGuard

import mitsuba as mi

from mitsuba_taxel.kernels.protocols import plugin_of
from mitsuba_taxel.kernels.taxel_pair import TaxelPair


class TaxelIntegrator(Protocol):
    """Interface of the integrators of this package, which trace pairs of LED and phototransistor."""

    def sample_paths(
        self,
        scene: mi.Scene,
        pair: TaxelPair,
        index: mi.UInt32,
        led_index: mi.UInt32,
        sampler: mi.Sampler,
        pixels: mi.Float | None,
    ) -> mi.Float: ...


def traces_taxels(integrator: mi.Integrator) -> TypeGuard[TaxelIntegrator]:
    """Whether an integrator traces pairs of LED and phototransistor.

    Parameters
    ----------
    integrator : mi.Integrator
        Any integrator.

    Returns
    -------
    bool
        True for the integrators of this package.
    """
    return plugin_of(integrator) in ("taxel_tracer", "taxel_path", "analog_tracer")


def guides_emission(integrator: mi.Integrator) -> bool:
    """Whether an integrator learns the directions of emission.

    Parameters
    ----------
    integrator : mi.Integrator
        Any integrator.

    Returns
    -------
    bool
        True for a `taxel_tracer`.
    """
    return plugin_of(integrator) == "taxel_tracer"
