"""Internal variables of a viscoelastic solid at the quadrature points of its elements."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.symmetry import SymmetricPart
from mitsuba_taxel.mechanics.materials.creep import Growth
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
        MPa, estimated errors of ``held``, as S does not change within steps as assumed.
    off : (m, q, 6) ndarray
        MPa, error of S that follows from these, where it is estimated.
    slope : (m, q, 6) ndarray or None
        MPa/s, rate of S at the time, or in the last step; None before the first, and just after a jump of the load.
    step : float
        Duration of that step in s.
    """

    stress: np.ndarray
    held: np.ndarray
    error: np.ndarray
    off: np.ndarray
    slope: np.ndarray | None = None
    step: float = 0.0

    @classmethod
    def at_rest(cls, material: Viscoelastic, elements: int, points: int) -> Relaxing:
        """Those of elements that were never loaded."""
        nothing = np.zeros((len(material.prony), elements, points, 6))
        return cls(np.zeros((elements, points, 6)), nothing, nothing, np.zeros((elements, points, 6)))

    def past(self, material: Viscoelastic, step: float, part: SymmetricPart, growth: Growth | None = None) -> Past:
        """Composition of the stress at the end of a further step in s, in which S is linear in time, or a parabola over
        its ``growth`` that begins with the slope."""
        known = np.tensordot(material.over(step).decay, self.held, axes=1)
        begun, gained = self._gains(material, step, growth)
        known -= float(gained.sum()) * self.stress
        if growth is not None:
            known += float(begun.sum()) * self.begun(growth)
        return Past(1 - float(material.shares.sum()) + float(gained.sum()), known, part)

    def after(self, material: Viscoelastic, step: float, stress: np.ndarray, growth: Growth | None = None) -> Relaxing:
        """The variables at the end of such a step, where the law gives ``stress``."""
        decay, change = material.over(step).decay, stress - self.stress
        begun, gained = self._gains(material, step, growth)
        held = _times(decay, self.held) + _times(gained, change)
        if growth is not None:
            held += _times(begun, self.begun(growth))
        error = _times(decay, self.error) - _times(gained, self.off)
        slope = change / step if step > 0 else None
        return Relaxing(stress, held, error, np.zeros_like(stress), slope, step)

    def _gains(self, material: Viscoelastic, step: float, growth: Growth | None) -> tuple[np.ndarray, np.ndarray]:
        """What is left of each term (k,) for what S would change by with its slope, and for the change of S."""
        if growth is None:
            ramp = material.shares * material.over(step).ramp
            return 0 * ramp, ramp
        first, square, _ = growth.moments(material.times).T
        return material.shares * (first - square), material.shares * square

    def begun(self, growth: Growth) -> np.ndarray:
        """(m, q, 6) MPa, the change of S over a growth on which it goes on as it does."""
        assert self.slope is not None
        return self.slope / growth.rate(0.0)

    def middle(self, stress: np.ndarray, growth: Growth) -> np.ndarray:
        """(m, q, 6) MPa, S midway on a parabola to a ``stress``."""
        return self.stress + 0.25 * (stress - self.stress + self.begun(growth))

    def ageing(self, material: Viscoelastic, growth: Growth, stress: np.ndarray) -> np.ndarray:
        """(m, q, 6) MPa/s, rate of the stress at the end of a further step by its length, where the law gives
        ``stress``, if that did not change."""
        end = self.after(material, growth.duration, stress, growth)
        left = float(material.shares @ (1 - growth.moments(material.times)[:, 1]))
        along = 2 * (stress - self.stress) - self.begun(growth)
        return left * growth.rate(growth.duration) * along - end.fading(material)

    def fading(self, material: Viscoelastic) -> np.ndarray:
        """(m, q, 6) MPa/s, rate at which the terms relax."""
        return np.tensordot(1 / material.times, self.held, axes=1)

    def bend(self, before: Relaxing) -> np.ndarray:
        """(m, q, 6) MPa/s², second derivative of S over this step and the one ``before``."""
        assert self.slope is not None and before.slope is not None
        return (self.slope - before.slope) / (0.5 * (self.step + before.step))

    def missed(self, material: Viscoelastic, bend: np.ndarray) -> np.ndarray:
        """(k, m, q, 6) MPa, error of a linear change of S in the last step."""
        return _times(material.shares * material.over(self.step).bend * self.step**2, bend)

    def missed_on(self, material: Viscoelastic, growth: Growth, bend: np.ndarray) -> np.ndarray:
        """(k, m, q, 6) MPa, error of a parabola over a growth, if S also has the third power of that, ``bend`` times,
        less as much of the square."""
        _, square, cube = growth.moments(material.times).T
        return _times(material.shares * (cube - square), bend)

    def off_by(self, error: np.ndarray) -> Relaxing:
        """The same with an ``error`` (k, m, q, 6) added."""
        return replace(self, error=self.error + error)

    def followed(self, material: Viscoelastic, off: np.ndarray, growth: Growth | None = None) -> Relaxing:
        """The same with an error of S (m, q, 6) at the end of the last step, which the terms follow."""
        gained = self._gains(material, self.step, growth)[1]
        return replace(self, error=self.error + _times(gained, off), off=off)

    def stress_error(self, material: Viscoelastic) -> np.ndarray:
        """(m, q, 6) MPa, estimated error of the stress."""
        return self.error.sum(axis=0) + (1 - float(material.shares.sum())) * self.off

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
        return Relaxing(on(self.stress), held, error, on(self.off), slope, self.step)


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
