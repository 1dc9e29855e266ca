"""Our integrators, told from Mitsuba's own and from third-party ones."""

from __future__ import annotations

from typing import Protocol, TypeGuard

import mitsuba as mi

from mitsuba_taxel.kernels.protocols import plugin_of
from mitsuba_taxel.kernels.taxel_pair import TaxelPair


class TaxelIntegrator(Protocol):
    """One of our integrators, which trace a pair of LED and phototransistor."""

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
    return plugin_of(integrator) in ("taxel_tracer", "taxel_path", "analog_tracer")


def guides_emission(integrator: mi.Integrator) -> bool:
    return plugin_of(integrator) == "taxel_tracer"
