"""Verification of the first and the best design on a finer mesh, with more points and another seed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from mitsuba_taxel.kernels.dome_elements import size_for_light
from mitsuba_taxel.optimum.designs import DesignEvaluation, DesignEvaluator, parts_of
from mitsuba_taxel.optimum.optimiser import Optimiser
from mitsuba_taxel.optimum.plan import Design
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.studies.run.pool import Pool

FINER = 0.75
"""Factor on the mesh size."""
MORE_POINTS = 4
"""Factor on the number of points."""
SAME_MESH = "the scene fixes its mesh size, so no finer mesh was tried: the effect of the mesh is unknown"


class FineDescent(NamedTuple):
    """A descent from the best design on the finer mesh.

    Attributes
    ----------
    gain : float
        Gain of the objective, relative to the objective of the best design on that mesh.
    designs : int
        Number of evaluated designs, without the best design.
    ended : bool
        Whether the descent ended because its steps gained nothing, not because all evaluations were used.
    """

    gain: float
    designs: int
    ended: bool


@dataclass(frozen=True, eq=False)
class MeshVerification:
    """The first and the best design of an optimisation, evaluated again on a finer mesh.

    Attributes
    ----------
    optimiser : Optimiser
        Designs on the finer mesh.
    first, winner : Design
        The first and the best design, with meshes that are not moved from other designs.
    reads : dict[str, DesignEvaluation]
        Evaluations of the two designs, as ``before_finer`` and ``best_finer``; empty if one fails.
    is_finer : bool
        Whether the mesh is finer; it is not if the scene fixes the mesh size.
    """

    optimiser: Optimiser
    first: Design
    winner: Design
    reads: dict[str, DesignEvaluation]
    is_finer: bool

    @property
    def notes(self) -> list[str]:
        """Remarks for the user on the evaluation on a finer mesh."""
        if not self.reads:
            return ["the best design could not be read on a finer mesh: its improvement is not verified"]
        return [*self.optimiser.designs.notes, *([] if self.is_finer else [SAME_MESH])]

    @property
    def finer(self) -> list[DesignEvaluation]:
        """List with the evaluation of the best design on the finer mesh; empty if the evaluation failed or the mesh is
        not finer.
        """
        return [self.reads["best_finer"]] if self.reads and self.is_finer else []

    def descend(self) -> FineDescent | None:
        """Run a descent from the best design on the finer mesh; None if its evaluation on this mesh failed."""
        if not self.finer:
            return None
        plan = self.optimiser.plan
        gain, designs = self.optimiser.gain_from(self.winner)
        return FineDescent(gain, designs, designs < plan.evaluations)


def verified_on_finer_mesh(optimiser: Optimiser, best: Design, pool: Pool, folder: Path) -> MeshVerification:
    """Evaluate the first and the best design of an optimisation on a finer mesh.

    Parameters
    ----------
    optimiser : Optimiser
        The optimisation.
    best : Design
        Best design of the run.
    pool : Pool
        Executes the jobs.
    folder : Path
        Folder of the new study.
    """
    plan, first, winner = optimiser.plan, optimiser.before.alone, best.alone
    scene = plan.scene(winner)
    pads = parts_of(scene)
    size = plan.batch.mesh_size or (_default_size(scene) if pads else None)
    finer = replace(
        plan.batch,
        points=MORE_POINTS * (plan.batch.points or 1),
        seed=plan.batch.seed + 1,
        mesh_size=None if size is None else float(f"{FINER * size:.3g}"),
    )
    fine_optimiser = Optimiser(plan, DesignEvaluator(plan, pool, folder, False, finer), None)
    names = zip(("before_finer", "best_finer"), fine_optimiser.evaluate([first, winner]), strict=True)
    reads = {name: read for name, read in names if read is not None}
    is_finer = not pads or bool(size and scene.leaves_mesh_open)
    return MeshVerification(fine_optimiser, first, winner, reads if len(reads) == 2 else {}, is_finer)


def _default_size(scene: Scene) -> float | None:
    """Default element size in mm of the built-in pads of a scene under load, the smallest of all; None without such a
    pad."""
    built = [pad for pad in deformed_pads(scene.load()) if isinstance(pad.pad, Pad)]
    sizes = (size_for_light(pad.pad, pad.load, [pad.bsdf()]) or pad.pad.default_mesh_size for pad in built)
    return min(sizes, default=None)
