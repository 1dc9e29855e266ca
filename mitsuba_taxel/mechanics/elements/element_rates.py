"""Derivatives of the internal forces of elements with respect to the material and to the undeformed nodes.

With G the gradient of the nodes' velocity V, integrals over the undeformed solid change by its divergence tr G, and
gradients by -(grad ...) G, so that F changes by -(F - 1) G (the material derivative of shape optimisation: J.
Sokolowski and J.-P. Zolesio, Introduction to Shape Optimization, 1992, chapter 2). This is exact for the discrete
forces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.mechanics.elements.elements import ELEMENTS_AT_ONCE, Elements, SmallStrain, cofactors, in_turns
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.moduli import Moduli

Forces = tuple[np.ndarray, np.ndarray]
"""Forces (m, 10, 3) of each of m elements, and volumes (m, 4)."""


@dataclass(frozen=True)
class _Chunk:
    """Quantities at the q quadrature points of a chunk of m elements in a deformed state.

    ``deformed`` is the deformation gradient F. All other fields are arguments and results of the constitutive law.
    Where the law is linear, they are computed with the identity as F, and ``small`` is the small strain.
    """

    here: slice
    deformed: np.ndarray
    gradient: np.ndarray
    determinant: np.ndarray
    cofactor: np.ndarray
    pressure: np.ndarray
    moduli: Moduli
    small: SmallStrain | None

    def stress(self, material: Material) -> tuple[np.ndarray, np.ndarray]:
        """First Piola-Kirchhoff stress (m, q, 3, 3) in MPa of a material, and the residual (m, q) of the equation
        between volume ratio and pressure."""
        inverse = self.cofactor / self.determinant[..., None, None]
        stress = material.stress(self.gradient, self.determinant, inverse)
        stress = stress + self.pressure[..., None, None] * self.cofactor
        excess = self.determinant - 1 - material.compressibility * self.pressure
        if self.small is not None:
            stress[self.small.at] += self.small.stress(material.shear_modulus)
            excess[self.small.at] += self.small.growth
        return stress, excess


class StrainedElements:
    """Elements of a mesh in a deformed state, given by displacement (N, 3) and pressure (corners,); no element is
    inverted."""

    def __init__(self, elements: Elements, displacement: np.ndarray, pressure: np.ndarray) -> None:
        self._elements = elements

        def chunk_at(start: int) -> _Chunk:
            here = slice(start, start + ELEMENTS_AT_ONCE)
            p = elements.pressures(here, pressure)
            deformed = elements.gradient(here, displacement) + np.eye(3)
            gradient, small = elements.at_rest(here, deformed)
            cofactor = cofactors(gradient)
            determinant = (gradient[..., 0, :] * cofactor[..., 0, :]).sum(axis=-1)
            turning = (
                p if small is None else np.where(small.at, 0.0, p)
            )  # forces of a linear law do not turn with the solid
            moduli = elements.material.moduli(gradient, determinant, cofactor / determinant[..., None, None], turning)
            return _Chunk(here, deformed, gradient, determinant, cofactor, p, moduli, small)

        self._chunks = in_turns(chunk_at, len(elements.nodes))

    def of(self, material: Material) -> Forces:
        """Internal forces and volumes of all elements at the same displacement, but of another material."""

        def forces(chunk: _Chunk) -> Forces:
            stress, excess = chunk.stress(material)
            return self._elements.on_nodes(chunk.here, stress), self._elements.on_corners(chunk.here, excess)

        return _joined([forces(chunk) for chunk in self._chunks])

    def rates(self, velocity: np.ndarray) -> Forces:
        """Rates of internal forces and volumes while the undeformed nodes move with a velocity (N, 3), at constant
        displacements.
        """

        def rate(chunk: _Chunk) -> Forces:
            velocity_gradient = self._elements.gradient(chunk.here, velocity)
            change, dilatation = (
                velocity_gradient - chunk.deformed @ velocity_gradient,
                np.trace(velocity_gradient, axis1=-2, axis2=-1),
            )
            stress, excess = chunk.stress(self._elements.material)
            convected = dilatation[..., None, None] * stress - stress @ np.swapaxes(velocity_gradient, -1, -2)
            excess = dilatation * excess + (chunk.cofactor * change).sum(axis=(-2, -1))
            stress = chunk.moduli.along(change) + convected
            return self._elements.on_nodes(chunk.here, stress), self._elements.on_corners(chunk.here, excess)

        return _joined([rate(chunk) for chunk in self._chunks])


def _joined(chunks: list[Forces]) -> Forces:
    forces, volumes = zip(*chunks, strict=True)
    return np.concatenate(forces), np.concatenate(volumes)
