"""Scenes prepared for a reading, before light is traced, with the errors of their shape and the chosen mesh and number
of points."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.convergence import FACETS_SHARE
from mitsuba_taxel.sensing.reading.readings import largest_share
from mitsuba_taxel.sensing.reading.runs import AnyScene, Prepared, Run
from mitsuba_taxel.sensing.scene.description import Scene

LIGHT_SHARE = 0.5
"""Fraction of a target error for the light if the mechanics does not reach the target."""
EXACT_SHARE = 0.75
"""Largest error of light without random numbers, relative to a target error, for which the elements are refined instead
of tracing random paths. This error cannot be reduced, but finer elements, for two thirds of the target error, take less
time than paths."""


class Settings(NamedTuple):
    """Number of points and mesh size of a reading.

    Attributes
    ----------
    points : int
        Number of points per taxel and replicate; 0 without random numbers.
    mesh_size : float or None
        Mesh size of the pads, in mm; None for that of the scene's description or the default.
    """

    points: int
    mesh_size: float | None


class MechanicsEstimate(NamedTuple):
    """Error of readings due to the finite elements.

    Attributes
    ----------
    deviation : (T,) ndarray or None
        Change of the power of each of T taxels on coarser finite elements, in W; see `Readings`. None if no pad is
        loaded.
    share : float
        Relative error of the readings; NaN if unknown.
    """

    deviation: np.ndarray | None
    share: float


class FacetsEstimate(NamedTuple):
    """Error of readings due to the flat triangles (facets) of curved walls and of walls with random heights.

    Attributes
    ----------
    facets : (T,) ndarray or None
        Change of the power of each of T taxels with inscribed triangles, in W; see `Readings`. None if there are no
        such walls.
    share : float
        Relative error of readings.
    pilot : Run or None
        The pilot run that :func:`points_for` continues, if any.
    heights : float
        Part of ``share`` due to random heights, which smaller elements do not change.
    """

    facets: np.ndarray | None
    share: float
    pilot: Run | None
    heights: float = 0.0


FLAT = FacetsEstimate(None, 0.0, None)


class ShapeErrors(NamedTuple):
    """Errors of readings due to the approximated shape of a scene's pads.

    Attributes
    ----------
    mechanics : MechanicsEstimate
        Error due to the finite elements.
    geometry : FacetsEstimate
        Error due to the triangles of curved walls or, without random numbers, due to the discretisation of the light.
    power : (T,) ndarray or None
        Readings in W, if computed without random numbers.
    """

    mechanics: MechanicsEstimate
    geometry: FacetsEstimate
    power: np.ndarray | None = None

    @property
    def share(self) -> float:
        """Relative error of all readings together; without random numbers, the total error of the worst reading."""
        return math.hypot(self.mechanics.share, self.light_share)

    @property
    def refinable_share(self) -> float:
        """Relative error of all readings that smaller elements reduce: ``share`` without the error due to random
        heights."""
        return math.sqrt(max(self.share**2 - self.geometry.heights**2, 0.0))

    @property
    def known_share(self) -> float:
        """Relative error of all readings; if the error of the mechanics is unknown, that of the geometry alone."""
        return self.light_share if math.isnan(self.mechanics.share) else self.share

    @property
    def light_share(self) -> float:
        """Relative error of the readings due to the geometry; without random numbers, the relative error of the light
        of the worst reading."""
        if self.power is None or self.geometry.facets is None:
            return self.geometry.share
        return FACETS_SHARE * largest_share(np.abs(self.geometry.facets), self.power)

    def suffices(self, target_error: float) -> bool:
        """Whether a relative target error can be reached without random numbers, with the present finite elements or
        with smaller ones.
        """
        return self.share <= target_error or self.light_share <= EXACT_SHARE * target_error


class PreparedFor(NamedTuple):
    """A scene prepared for a target error.

    Attributes
    ----------
    ready : Prepared
        The scene.
    errors : ShapeErrors
        Errors due to the shape of the scene's pads; also the readings, if no random paths are needed.
    settings : Settings
        Settings of the reading.
    light_error : float
        Relative standard error that random paths should reach.
    alternative : PreparedFor or None
        The same scene with readings computed without random numbers, whose error exceeds the target but may still be
        smaller than that of random paths.
    """

    ready: Prepared
    errors: ShapeErrors
    settings: Settings
    light_error: float = math.inf
    alternative: PreparedFor | None = None


def mesh_size_of(scene: AnyScene) -> float | None:
    """Size in mm of the finite elements that was chosen for a scene; None for the default."""
    return scene.mesh_size if isinstance(scene, Scene) else None


def prepared_without_random_numbers(ready: Prepared, scene: AnyScene, errors: ShapeErrors) -> PreparedFor:
    """Combine a scene and its readings, computed without random numbers, to a prepared scene.

    Parameters
    ----------
    ready : Prepared
        The scene, loaded.
    scene : AnyScene
        The scene as described.
    errors : ShapeErrors
        Errors of the readings, and the readings.

    Returns
    -------
    PreparedFor
        The prepared scene, with 0 points.
    """
    return PreparedFor(ready, errors, Settings(0, mesh_size_of(scene)))
