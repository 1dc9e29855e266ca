"""Recorded kernels: paths that Dr.Jit traces once and launches again with other random numbers.

Tracing a path in Python takes longer than computing a short wavefront of it. From the second wavefront of a size on,
kernels are therefore recorded (``dr.freeze``). Recordings are valid as long as the scene does not change: a recorded
kernel reads arrays of numpy, such as moved vertices, from the memory of its first launch.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.scene_state import SceneState, UnknownState

MOST_SIZES = 8
"""Largest number of wavefront sizes whose recordings are kept for a phototransistor array."""
MOST_LANES = 1 << 18
"""Largest wavefront that is recorded: larger wavefronts take far longer than tracing. A recorded kernel is a tenth
slower, as it reads from memory the number of the point of each lane, which a traced kernel computes."""

Trace = Callable[[Any, Any, Any, Any], Any]
"""Function of scene, sampler, phototransistor and LED of each path that returns its power."""


class RecordedPaths:
    """Kernels of Dr.Jit that trace the light paths of a scene, recorded once and used again; cached with the
    phototransistor.
    """

    def __init__(self) -> None:
        self.state: SceneState | None = None
        # By lanes and points; None for a size that cannot be recorded.
        self.sizes: dict[tuple[int, int], _Recording | None] = {}

    def power(
        self,
        trace: Trace,
        scene: mi.Scene,
        sampler: mi.Sampler,
        index: mi.UInt32,
        led_index: mi.UInt32,
        *objects: Any,
    ) -> mi.Float:
        """Trace light paths by the function ``trace``, with a recorded kernel if possible; returns the power of each
        path in W.

        Parameters
        ----------
        trace : Trace
            Function that traces the paths.
        scene, sampler, index, led_index
            Arguments of ``trace``.
        *objects : Any
            Other objects on which the result depends.

        Returns
        -------
        mi.Float
            Power of each path, W.
        """
        if dr.width(index) > MOST_LANES:
            return trace(scene, sampler, index, led_index)
        # Evaluated inputs give the same kernel each time.
        dr.eval(sampler.index, sampler.sequence_seed, index, led_index)
        recording = self._of(scene, (dr.width(index), sampler.sample_count()), objects)
        if recording is not None:
            try:
                assert self.state is not None
                return recording(trace, scene, sampler, index, led_index, self.state.variables)
            except RuntimeError as error:
                # Dr.Jit cannot record: its kernels also contain objects of other packages in other scenes.
                if isinstance(error.__cause__, KeyboardInterrupt):
                    raise error.__cause__ from None
                self.sizes = dict.fromkeys(self.sizes)
        return trace(scene, sampler, index, led_index)

    def _of(self, scene: mi.Scene, size: tuple[int, int], objects: tuple[Any, ...]) -> _Recording | None:
        """Recorded kernel for wavefronts of a size; None for the first wavefront of this size, or if recording is
        impossible."""
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
    """The recorded kernel of a wavefront; it has no reference to the scene, which can therefore be deleted."""

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
        # A clone, so that the state of the sampler is not an output of the kernel.
        return self.trace(scene, sampler.clone(), index, led_index)
