"""Internal variables of a viscoelastic solid, or of one with Mullins' effect, at the quadrature points of its elements.

All stresses here are second Piola-Kirchhoff, in MPa, with six components per point. S is the stress of the
instantaneous law, Q_i that of a term of the Prony series. Within a step, S is linear in time or, if a ``growth`` is
given, a parabola as a function of that measure of time, whose initial slope is the rate of S.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.symmetry import SymmetricPart
from mitsuba_taxel.mechanics.materials.creep import Growth
from mitsuba_taxel.mechanics.materials.mullins import Mullins
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic, components, tensors


@dataclass(frozen=True, eq=False)
class StressUpdate:
    """The isochoric stress at the end of a step, factor * S + offset, as a function of the stress S of the law.

    Attributes
    ----------
    factor : float
        Factor of the stress S of the law at the end.
    offset : (m, q, 6) ndarray
        Stress that remains from the start of the step, in MPa, at the quadrature points of a part of the mesh.
    part : SymmetricPart
        The part.
    """

    factor: float
    offset: np.ndarray
    part: SymmetricPart

    def on(self, part: SymmetricPart, whole: VolumeMesh) -> StressUpdate:
        """Convert this stress update to another symmetric part of the same mesh."""
        if part is self.part:
            return self
        return StressUpdate(self.factor, expand_stress(self.offset, self.part, whole)[part.elements], part)


@dataclass(frozen=True, eq=False)
class Softening:
    """The isochoric stress of a silicone with Mullins' effect at the end of a step, as a function of the strain at the
    end.

    Attributes
    ----------
    mullins : Mullins
        The material.
    largest : (m, q) ndarray
        Largest energy density of the law before the step, in MPa, at the quadrature points of a part of the mesh.
    part : SymmetricPart
        The part.
    """

    mullins: Mullins
    largest: np.ndarray
    part: SymmetricPart

    def on(self, part: SymmetricPart, whole: VolumeMesh) -> Softening:
        """Convert this softening to another symmetric part of the same mesh."""
        if part is self.part:
            return self
        return Softening(self.mullins, expand_scalar(self.largest, self.part, whole)[part.elements], part)


@dataclass(frozen=True, eq=False)
class InternalVariables:
    """The internal variables of a solid at a time, for m elements with q quadrature points and k viscoelastic terms.

    Attributes
    ----------
    stress : (m, q, 6) ndarray
        Stress S of the law, MPa.
    term_stress : (k, m, q, 6) ndarray
        Stress Q of each term, MPa.
    error : (k, m, q, 6) ndarray
        Estimated error of ``term_stress`` in MPa, because S does not change within steps as assumed.
    law_error : (m, q, 6) ndarray
        Resulting error of S in MPa; 0 if it is not estimated.
    rate : (m, q, 6) ndarray or None
        Rate of S in MPa/s: at this time, or the mean over the last step. None before the first step, and just after a
        jump of the load.
    step : float
        Duration of the last step in s.
    largest_energy : (m, q) ndarray or None
        Largest energy density of the law so far in MPa; None without Mullins' effect. With it, m is 0 for all others.
    """

    stress: np.ndarray
    term_stress: np.ndarray
    error: np.ndarray
    law_error: np.ndarray
    rate: np.ndarray | None = None
    step: float = 0.0
    largest_energy: np.ndarray | None = None

    @classmethod
    def at_rest(cls, material: Viscoelastic, elements: int, points: int) -> InternalVariables:
        """Internal variables of elements that were never loaded (zeros), for a number of quadrature points in each
        element.
        """
        largest = None
        if material.softening is not None:
            largest, elements = np.zeros((elements, points)), 0
        zero = np.zeros((len(material.prony), elements, points, 6))
        stress = np.zeros((elements, points, 6))
        return cls(stress, zero, zero, np.zeros_like(stress), largest_energy=largest)

    def stress_update(
        self, material: Viscoelastic, step: float, part: SymmetricPart, growth: Growth | None = None
    ) -> StressUpdate | Softening:
        """The stress at the end of the next step, as a function of the stress of the law.

        Parameters
        ----------
        material : Viscoelastic
            The silicone.
        step : float
            Duration of the step in s.
        part : SymmetricPart
            Part of the mesh that these variables belong to.
        growth : Growth, optional
            Measure of time as a function of which S is a parabola.

        Returns
        -------
        StressUpdate or Softening
            Update of the isochoric stress.
        """
        if material.softening is not None:
            assert self.largest_energy is not None
            return Softening(material.softening, self.largest_energy, part)
        offset = np.tensordot(material.over(step).decay, self.term_stress, axes=1)
        by_rate, by_change = self._weights(material, step, growth)
        offset -= float(by_change.sum()) * self.stress
        if growth is not None:
            offset += float(by_rate.sum()) * self._initial_change(growth)
        return StressUpdate(1 - float(material.shares.sum()) + float(by_change.sum()), offset, part)

    def after(
        self, material: Viscoelastic, step: float, stress: np.ndarray, growth: Growth | None = None
    ) -> InternalVariables:
        """The internal variables at the end of the next time step.

        Parameters
        ----------
        material : Viscoelastic
            The silicone.
        step : float
            Duration of the step in s.
        stress : (m, q, 6) ndarray
            Stress S of the law at the end of the step, MPa.
        growth : Growth, optional
            Measure of time as a function of which S is a parabola.

        Returns
        -------
        InternalVariables
            Internal variables at the end of the step.
        """
        decay, change = material.over(step).decay, stress - self.stress
        by_rate, by_change = self._weights(material, step, growth)
        term_stress = _scaled(decay, self.term_stress) + _scaled(by_change, change)
        if growth is not None:
            term_stress += _scaled(by_rate, self._initial_change(growth))
        error = _scaled(decay, self.error) - _scaled(by_change, self.law_error)
        rate = change / step if step > 0 else None
        return InternalVariables(stress, term_stress, error, np.zeros_like(stress), rate, step)

    def after_energy(self, energy: np.ndarray) -> InternalVariables:
        """The internal variables after a step with Mullins' effect. ``energy`` (m, q) in MPa is the energy density of
        the law at the end of the step. The energy density of a point is assumed to have its maximum at an end of the
        step.
        """
        assert self.largest_energy is not None
        return replace(self, largest_energy=np.maximum(self.largest_energy, energy))

    def _weights(self, material: Viscoelastic, step: float, growth: Growth | None) -> tuple[np.ndarray, np.ndarray]:
        """Two weights (k,) in the update of each of the k viscoelastic terms at the end of a step: the first multiplies
        the initial change of the stress S (see :meth:`_initial_change`), the second the whole change of S.
        """
        if growth is None:
            ramp = material.shares * material.over(step).ramp
            return 0 * ramp, ramp
        first, square, _ = growth.moments(material.times).T
        return material.shares * (first - square), material.shares * square

    def _initial_change(self, growth: Growth) -> np.ndarray:
        """Change (m, q, 6) in MPa of the stress S over a whole step if S continued at its initial rate, linearly in the
        ``growth``."""
        assert self.rate is not None
        return self.rate / growth.rate(0.0)

    def mid_stress(self, stress: np.ndarray, growth: Growth) -> np.ndarray:
        """Stress S (m, q, 6) of the law in MPa in the middle of the next step. S is a parabola in ``growth`` and has
        the value ``stress`` at the end.
        """
        return self.stress + 0.25 * (stress - self.stress + self._initial_change(growth))

    def rate_by_duration(self, material: Viscoelastic, growth: Growth, stress: np.ndarray) -> np.ndarray:
        """Derivative (m, q, 6) in MPa/s of the stress at the end of the next step with respect to the duration of that
        step.

        The ``stress`` (m, q, 6) of the law at the end stays constant.
        """
        end = self.after(material, growth.duration, stress, growth)
        weight = float(material.shares @ (1 - growth.moments(material.times)[:, 1]))
        slope = 2 * (stress - self.stress) - self._initial_change(growth)
        return weight * growth.rate(growth.duration) * slope - end.relaxation_rate(material)

    def relaxation_rate(self, material: Viscoelastic) -> np.ndarray:
        """Rate (m, q, 6) in MPa/s at which the terms relax: the sum of Q_i / tau_i."""
        return np.tensordot(1 / material.times, self.term_stress, axes=1)

    def curvature(self, before: InternalVariables) -> np.ndarray:
        """Second time derivative (m, q, 6) of S in MPa/s², from the last step and the step ``before``."""
        assert self.rate is not None and before.rate is not None
        return (self.rate - before.rate) / (0.5 * (self.step + before.step))

    def linear_step_error(self, material: Viscoelastic, curvature: np.ndarray) -> np.ndarray:
        """Error of the stresses of the viscoelastic terms by the last step.

        S is the stress of the instantaneous law. The step assumed that S is linear in time. The error is proportional
        to the second time derivative of S.

        Parameters
        ----------
        material : Viscoelastic
            The silicone, with k terms of its Prony series.
        curvature : (m, q, 6) ndarray
            Second time derivative of S in MPa/s², at the q quadrature points of each of m elements.

        Returns
        -------
        (k, m, q, 6) ndarray
            Error of the stress of each term, MPa.
        """
        return _scaled(material.shares * material.over(self.step).curvature * self.step**2, curvature)

    def parabolic_step_error(self, material: Viscoelastic, growth: Growth, cubic: np.ndarray) -> np.ndarray:
        """Error (k, m, q, 6) in MPa of the viscoelastic terms due to the last step. The step assumed that the stress S
        is a parabola in the growth g; the true S is assumed to contain also ``cubic`` (m, q, 6) times g³ - g²."""
        _, square, cube = growth.moments(material.times).T
        return _scaled(material.shares * (cube - square), cubic)

    def with_error(self, error: np.ndarray) -> InternalVariables:
        """Copy of the variables; ``error`` (k, m, q, 6) is added to the estimated error of the terms' stresses."""
        return replace(self, error=self.error + error)

    def with_law_error(
        self, material: Viscoelastic, law_error: np.ndarray, growth: Growth | None = None
    ) -> InternalVariables:
        """Copy of the variables with the error ``law_error`` (m, q, 6) of the stress S at the end of the last step. Its
        effect on the viscoelastic terms is added to their error.
        """
        by_change = self._weights(material, self.step, growth)[1]
        return replace(self, error=self.error + _scaled(by_change, law_error), law_error=law_error)

    def stress_error(self, material: Viscoelastic) -> np.ndarray:
        """Estimated error (m, q, 6) in MPa of the stress."""
        return self.error.sum(axis=0) + (1 - float(material.shares.sum())) * self.law_error

    def overstress(self, material: Viscoelastic) -> np.ndarray:
        """Stress (m, q, 6) in MPa in addition to the stress S of the instantaneous law."""
        return self.term_stress.sum(axis=0) - float(material.shares.sum()) * self.stress

    def on(self, part: SymmetricPart, whole: VolumeMesh, own: SymmetricPart) -> InternalVariables:
        """Convert the internal variables from the symmetric part ``own`` to another symmetric part of the same mesh."""
        if part is own:
            return self
        if self.largest_energy is not None:
            return replace(self, largest_energy=expand_scalar(self.largest_energy, own, whole)[part.elements])

        def moved(field: np.ndarray) -> np.ndarray:
            return expand_stress(field, own, whole)[part.elements]

        rate = None if self.rate is None else moved(self.rate)
        term_stress, error = (np.array([moved(term) for term in terms]) for terms in (self.term_stress, self.error))
        return InternalVariables(moved(self.stress), term_stress, error, moved(self.law_error), rate, self.step)


def expand_stress(stress: np.ndarray, part: SymmetricPart, whole: VolumeMesh) -> np.ndarray:
    """Stress of a whole mesh, from the stress of its symmetric part.

    Parameters
    ----------
    stress : (m, q, 6) ndarray
        Stress at the quadrature points of the part, MPa.
    part : SymmetricPart
        The part.
    whole : VolumeMesh
        The whole mesh.

    Returns
    -------
    (M, q, 6) ndarray
        Stress at the quadrature points of the whole mesh, MPa.
    """
    turn = part.element_images(whole)[2]
    images = tensors(_images(stress, part, whole))
    return components(turn[:, None] @ images @ np.swapaxes(turn, -1, -2)[:, None])


def expand_scalar(scalar: np.ndarray, part: SymmetricPart, whole: VolumeMesh) -> np.ndarray:
    """Scalar field of a whole mesh, from the field of its symmetric part.

    Parameters
    ----------
    scalar : (m, q) ndarray
        Field at the quadrature points of the part.
    part : SymmetricPart
        The part.
    whole : VolumeMesh
        The whole mesh.

    Returns
    -------
    (M, q) ndarray
        Field at the quadrature points of the whole mesh.
    """
    return _images(scalar[..., None], part, whole)[..., 0]


def _images(field: np.ndarray, part: SymmetricPart, whole: VolumeMesh) -> np.ndarray:
    """Copy the components (m, q, c) of a field at the quadrature points of a symmetric part to the whole mesh, (M, q,
    c). Components of vectors and tensors are not reflected.
    """
    element, corner, _ = part.element_images(whole)
    # Quadrature points are numbered by the corners they are near.
    families = field.reshape(len(field), -1, 4, field.shape[-1])
    return families[element[:, None], :, corner].swapaxes(1, 2).reshape(len(element), -1, field.shape[-1])


def _scaled(factors: np.ndarray, fields: np.ndarray) -> np.ndarray:
    """Multiply k fields (k, m, q, 6), or k copies of one field (m, q, 6), by k factors (k,)."""
    return factors[:, None, None, None] * fields
