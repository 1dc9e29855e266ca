"""Paths that Dr.Jit traces once, to launch their kernels again with other random numbers.

Tracing a path in Python takes longer than a short wavefront of it. So from the second wavefront of a size on, its
kernels are recorded (``dr.freeze``), as long as nothing in the scene is changed: what was read from memory of numpy's,
such as vertices that were moved, would else be read from there again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.scene_state import SceneState, UnknownState

MOST_SIZES = 8
"""Most sizes of wavefronts that are kept for one phototransistor array."""
MOST_LANES = 1 << 18
"""Of a wavefront that is worth it: larger ones take far longer than tracing, and a tenth longer still where their
kernel reads from memory which point each lane takes, which it else computes."""

Trace = Callable[[Any, Any, Any, Any], Any]
"""Scene, sampler, phototransistor and LED of each path -> its power."""


class RecordedPaths:
    """Recorded wavefronts of a scene, kept with the phototransistor that they are read by."""

    def __init__(self) -> None:
        self.state: SceneState | None = None
        self.sizes: dict[tuple[int, int], _Recording | None] = {}  # lanes and points; None: it cannot be recorded

    def power(
        self,
        trace: Trace,
        scene: mi.Scene,
        sampler: mi.Sampler,
        index: mi.UInt32,
        led_index: mi.UInt32,
        *objects: Any,
    ) -> mi.Float:
        """What ``trace`` returns, which depends on the scene and ``objects``."""
        if dr.width(index) > MOST_LANES:
            return trace(scene, sampler, index, led_index)
        dr.eval(sampler.index, sampler.sequence_seed, index, led_index)  # so that the kernel is the same
        recording = self._of(scene, (dr.width(index), sampler.sample_count()), objects)
        if recording is not None:
            try:
                assert self.state is not None
                return recording(trace, scene, sampler, index, led_index, self.state.variables)
            except RuntimeError as error:  # of Dr.Jit: foreign objects of other scenes, too, are part of its kernels
                if isinstance(error.__cause__, KeyboardInterrupt):
                    raise error.__cause__ from None
                self.sizes = dict.fromkeys(self.sizes)
        return trace(scene, sampler, index, led_index)

    def _of(self, scene: mi.Scene, size: tuple[int, int], objects: tuple[Any, ...]) -> _Recording | None:
        """The recording of wavefronts of a size, if there was one before."""
        if dr.backend_v(mi.Float) != dr.JitBackend.LLVM or not isinstance(scene, mi.Scene):
            return None
        try:
            state = SceneState(scene, *objects)
        except UnknownState:
            return None
        if state != self.state:
            self.state, self.sizes = state, {}
        if size in self.sizes:
            return self.sizes[size]
        for oldest in list(self.sizes)[: max(len(self.sizes) + 1 - MOST_SIZES, 0)]:
            del self.sizes[oldest]
        self.sizes[size] = _Recording()
        return None


class _Recording:
    """A wavefront of one size; it holds no scene, so that this can be given up."""

    def __init__(self) -> None:
        self.trace: Trace | None = None
        self.frozen = dr.freeze(self._traced, limit=1, warn_after=1 << 30)

    def __call__(self, trace: Trace, *inputs: Any) -> mi.Float:
        self.trace = trace
        try:
            return self.frozen(*inputs)
        finally:
            self.trace = None

    def _traced(self, scene, sampler, index, led_index, variables):
        assert self.trace is not None
        return self.trace(scene, sampler.clone(), index, led_index)  # whose state is no result
