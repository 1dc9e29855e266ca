"""Internal variables of a viscoelastic solid at the quadrature points of its elements."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.symmetry import SymmetricPart
from mitsuba_taxel.mechanics.materials.symmetric import components, tensors
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic


@dataclass(frozen=True, eq=False)
class Past:
    """The stress at the end of a step: a ``share`` of that of the law there, plus one known beforehand.

    Attributes
    ----------
    stress : (m, q, 6) ndarray
        MPa, second Piola-Kirchhoff, at the quadrature points of a part.
    """

    share: float
    stress: np.ndarray
    part: SymmetricPart

    def on(self, part: SymmetricPart, whole: VolumeMesh) -> Past:
        """The same on another part of the whole mesh."""
        if part is self.part:
            return self
        return Past(self.share, spread(self.stress, self.part, whole)[part.elements], part)


@dataclass(frozen=True, eq=False)
class Relaxing:
    """The internal variables of a viscoelastic solid at a time.

    Attributes
    ----------
    stress : (m, q, 6) ndarray
        MPa, second Piola-Kirchhoff stress S of the law.
    held : (k, m, q, 6) ndarray
        MPa, Q of each term.
    error : (k, m, q, 6) ndarray
        MPa, estimated errors of ``held``, as S does not change linearly within a step.
    slope : (m, q, 6) ndarray or None
        MPa/s, rate of S in the last step; None before the first, and just after a jump of the load.
    step : float
        Duration of that step in s.
    """

    stress: np.ndarray
    held: np.ndarray
    error: np.ndarray
    slope: np.ndarray | None = None
    step: float = 0.0

    @classmethod
    def at_rest(cls, terms: int, elements: int, points: int) -> Relaxing:
        nothing = np.zeros((terms, elements, points, 6))
        return cls(np.zeros((elements, points, 6)), nothing, nothing)

    def past(self, material: Viscoelastic, step: float, part: SymmetricPart) -> Past:
        """Composition of the stress at the end of a further step in s."""
        weights = material.over(step)
        gained = float(material.shares @ weights.ramp)
        known = np.tensordot(weights.decay, self.held, axes=1) - gained * self.stress
        return Past(1 - float(material.shares.sum()) + gained, known, part)

    def after(self, material: Viscoelastic, step: float, stress: np.ndarray) -> Relaxing:
        """The variables at the end of a further step, where the law gives ``stress``."""
        weights = material.over(step)
        change = stress - self.stress
        held = _times(weights.decay, self.held) + _times(material.shares * weights.ramp, change)
        error = _times(weights.decay, self.error)
        return Relaxing(stress, held, error, change / step if step > 0 else None, step)

    def ageing(self, material: Viscoelastic, step: float, stress: np.ndarray) -> np.ndarray:
        """(m, q, 6) MPa/s, rate of the stress at the end of a further step by its length, where the law gives
        ``stress``."""
        weights = material.over(step)
        rate = float(material.shares @ (weights.ramp_rate / material.times))
        return rate * (stress - self.stress) - np.tensordot(weights.decay / material.times, self.held, axes=1)

    def bend(self, before: Relaxing) -> np.ndarray:
        """(m, q, 6) MPa/s², second derivative of S over this step and the one ``before``."""
        assert self.slope is not None and before.slope is not None
        return (self.slope - before.slope) / (0.5 * (self.step + before.step))

    def missed(self, material: Viscoelastic, bend: np.ndarray) -> np.ndarray:
        """(k, m, q, 6) MPa, error of a linear change of S in the last step."""
        return _times(material.shares * material.over(self.step).bend * self.step**2, bend)

    def off_by(self, error: np.ndarray) -> Relaxing:
        """The same with an ``error`` (k, m, q, 6) added."""
        return replace(self, error=self.error + error)

    def overstress(self, material: Viscoelastic) -> np.ndarray:
        """(m, q, 6) MPa, stress in addition to that of the law."""
        return self.held.sum(axis=0) - float(material.shares.sum()) * self.stress

    def spread(self, part: SymmetricPart, whole: VolumeMesh, to: SymmetricPart) -> Relaxing:
        """The same on another part of the whole mesh."""
        if to is part:
            return self

        def on(field: np.ndarray) -> np.ndarray:
            return spread(field, part, whole)[to.elements]

        slope = None if self.slope is None else on(self.slope)
        held, error = (np.array([on(term) for term in terms]) for terms in (self.held, self.error))
        return Relaxing(on(self.stress), held, error, slope, self.step)


def spread(field: np.ndarray, part: SymmetricPart, whole: VolumeMesh) -> np.ndarray:
    """(M, q, 6) tensors at the quadrature points of a whole mesh, from those (m, q, 6) of a symmetric part."""
    element, corner, turn = part.element_images(whole)
    families = field.reshape(len(field), -1, 4, 6)  # quadrature points are numbered by the corners they are near
    found = tensors(families[element[:, None], :, corner].swapaxes(1, 2).reshape(len(element), -1, 6))
    turned = turn[:, None] @ found @ np.swapaxes(turn, -1, -2)[:, None]
    return components(turned)


def _times(factors: np.ndarray, fields: np.ndarray) -> np.ndarray:
    """(k, m, q, 6) fields, or one of them (m, q, 6), times factors (k,)."""
    return factors[:, None, None, None] * fields
