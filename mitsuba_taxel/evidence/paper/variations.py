"""Effects on the sensitivities of choices that the paper leaves open, one at a time and in pairs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.loading import normal, settings_of
from mitsuba_taxel.evidence.paper.paper_studies import MissingStudy, PaperStudies
from mitsuba_taxel.evidence.paper.plate import LAWS, SPACINGS
from mitsuba_taxel.evidence.paper.scenes import CENTRE, CORNER, moduli, write_scene
from mitsuba_taxel.studies import sweep
from mitsuba_taxel.studies.plan.files import make_folder

POINTS = {"parallelepiped": 16384, "cylindrical": 16384, "spherical": 16384, "hemispheric": 32768}
"""Light paths for each reading and randomisation where slopes are differences of readings: light scattered many times
within a dome needs more. Over such steps, these have much less noise than derivatives by random paths in the same time.
"""
NORMAL = "0,-10,-20"
TANGENTIAL = "0,4,8"
"""Force steps in N; the tangential ones are under the paper's normal force, and within the limits of all shapes."""

NOMINAL, NOMINAL_SPACING, NOMINAL_LAW = "nominal", 0.9, "uniform_solid_angle"
ROOFS = {"isotropic": "isotropic", "lambertian": "Lambertian", "mirror": "mirror"}


@dataclass(frozen=True)
class PaperVariation:
    """A variation of the nominal sensor, in words and as parameters of the scene, and whether it is a single choice."""

    words: str
    values: dict[str, Any]
    single: bool = True

    @property
    def name(self) -> str:
        return "_".join(self.words.replace(",", "").replace("=", "").split())

    @property
    def cost(self) -> int:
        """Sort key by computing time: variations with random paths take longest, then those with other pads."""
        return 2 * (not self.has_derivatives) + ("c10" in self.values)

    @property
    def has_derivatives(self) -> bool:
        """Whether derivatives of the readings with respect to the force are available without random numbers."""
        return self.values.get("scattering") != "mirror"


def choices() -> list[PaperVariation]:
    """All variations: the nominal sensor, then one choice at a time, then pairs (spacing and law, roof and law)."""
    spacings = [PaperVariation(f"spacing {s:g} mm", {"spacing": s}) for s in SPACINGS if s != NOMINAL_SPACING]
    laws = [PaperVariation(f"LED {law}", {"law": law}) for law in LAWS if law != NOMINAL_LAW]
    roofs = [
        PaperVariation(f"{word} roof", {"scattering": value}) for value, word in ROOFS.items() if value != "isotropic"
    ]
    further = [
        PaperVariation("phototransistor along y", {"detector_width": 0.3, "detector_depth": 0.52}),
        PaperVariation("no dark centre", {"hole": 0}),
        PaperVariation("dark centre 0.15 mm", {"hole": 0.15}),
        *(PaperVariation(f"Poisson's ratio {ratio:g}", moduli(ratio)) for ratio in (0.45, 0.499)),
        PaperVariation("Mooney-Rivlin, c10 = c01", moduli(0.49, share_of_c01=0.5)),
        PaperVariation("package reflects 50%", {"body_reflectance": 0.5}),
    ]
    pairs = [both(variation, law) for first in (spacings, roofs) for variation in first for law in laws]
    return [PaperVariation(NOMINAL, {}, single=False), *spacings, *laws, *roofs, *further, *pairs]


def both(first: PaperVariation, second: PaperVariation) -> PaperVariation:
    """Combine two variations of the nominal sensor into one variation."""
    return PaperVariation(f"{first.words}, {second.words}", first.values | second.values, single=False)


def vary(store: PaperStudies, workers: int | None) -> dict[str, dict[str, dict[str, xr.Dataset]]]:
    """Compute readings of the corner and the centre taxel, by variation (in words), cell shape and force (fz, fx, fy).

    The mesh size is that of :func:`~mitsuba_taxel.evidence.paper.loading.normal`. Missing readings are computed. A
    tangential force along y is computed as a force along x on a sensor with packages turned by 90 degrees. The
    variations that take longest are computed last. If the store is read-only, the complete variations are returned.

    Raises
    ------
    MissingStudy
        if the studies of the nominal sensor are missing.
    """
    scene = store.folder / "variations" / "choices.xml"
    studies = {}
    for choice in sorted(choices(), key=lambda choice: choice.cost):
        try:
            studies[choice.words] = {cell: _loads(store, scene, choice, cell, workers) for cell in paper.CELLS}
        except MissingStudy:
            if NOMINAL not in studies:
                raise
    return {choice.words: studies[choice.words] for choice in choices() if choice.words in studies}


def _loads(
    store: PaperStudies, scene: Path, choice: PaperVariation, cell: str, workers: int | None
) -> dict[str, xr.Dataset]:
    return {force: _load(store, scene, choice, cell, force, workers) for force in ("fz", "fx", "fy")}


def _load(
    store: PaperStudies, scene: Path, choice: PaperVariation, cell: str, force: str, workers: int | None
) -> xr.Dataset:
    steps = NORMAL if force == "fz" else TANGENTIAL
    constant = {} if force == "fz" else {"fz": -paper.CONSTANT_NORMAL_FORCE}
    derivatives = (force,) if choice.has_derivatives else ()
    points = None if derivatives else POINTS[cell]
    mesh_size = settings_of(normal(store, cell))["mesh_size"]
    settings = {"points": points, "mesh_size": mesh_size, "derivatives": derivatives}

    def compute() -> xr.Dataset:
        make_folder(scene.parent)
        write_scene(scene, (CORNER, CENTRE))
        defines = {**choice.values, **constant, "cell": cell}
        study = sweep(scene, {force: steps}, defines, workers=workers, **settings)
        if study.attrs["failures"]:
            raise ComputationError(study.attrs["failures"].splitlines()[0])
        return study.assign_coords(taxel=[CORNER, CENTRE])

    request = {"values": choice.values, force: steps, **settings}
    return store.study(f"variations/{choice.name}/{cell}_{force}", request, compute)
