"""Rates of the internal forces of elements with the material and with the undeformed nodes.

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
class _Piece:
    """Some of the elements at a state: F; F again, det F, its cofactors, p and the moduli as the law has them, which is
    at rest where it is linear; and what it leaves out there."""

    here: slice
    deformed: np.ndarray
    gradient: np.ndarray
    determinant: np.ndarray
    cofactor: np.ndarray
    pressure: np.ndarray
    moduli: Moduli
    small: SmallStrain | None

    def of(self, material: Material) -> tuple[np.ndarray, np.ndarray]:
        """Total stress in MPa with a material, and the relative excess of volume."""
        inverse = self.cofactor / self.determinant[..., None, None]
        stress = material.stress(self.gradient, self.determinant, inverse)
        stress = stress + self.pressure[..., None, None] * self.cofactor
        excess = self.determinant - 1 - material.compressibility * self.pressure
        if self.small is not None:
            stress[self.small.at] += self.small.stress(material.shear_modulus)
            excess[self.small.at] += self.small.growth
        return stress, excess


class StrainedElements:
    """Elements at a displacement (N, 3) and pressure (corners,) at which none is inverted."""

    def __init__(self, elements: Elements, displacement: np.ndarray, pressure: np.ndarray) -> None:
        self._elements = elements

        def piece(start: int) -> _Piece:
            here = slice(start, start + ELEMENTS_AT_ONCE)
            p = elements.pressures(here, pressure)
            deformed = elements.gradient(here, displacement) + np.eye(3)
            gradient, small = elements.at_rest(here, deformed)
            cofactor = cofactors(gradient)
            determinant = (gradient[..., 0, :] * cofactor[..., 0, :]).sum(axis=-1)
            turning = p if small is None else np.where(small.at, 0.0, p)  # its force does not turn with the solid
            moduli = elements.material.moduli(gradient, determinant, cofactor / determinant[..., None, None], turning)
            return _Piece(here, deformed, gradient, determinant, cofactor, p, moduli, small)

        self._pieces = in_turns(piece, len(elements.nodes))

    def of(self, material: Material) -> Forces:
        """Forces and volumes with another material."""

        def forces(piece: _Piece) -> Forces:
            stress, excess = piece.of(material)
            return self._elements.on_nodes(piece.here, stress), self._elements.on_corners(piece.here, excess)

        return _joined([forces(piece) for piece in self._pieces])

    def rates(self, velocity: np.ndarray) -> Forces:
        """Rates of these while the undeformed nodes move by a velocity (N, 3)."""

        def rate(piece: _Piece) -> Forces:
            spread = self._elements.gradient(piece.here, velocity)
            change, growth = spread - piece.deformed @ spread, np.trace(spread, axis1=-2, axis2=-1)
            stress, excess = piece.of(self._elements.material)
            turned = growth[..., None, None] * stress - stress @ np.swapaxes(spread, -1, -2)
            excess = growth * excess + (piece.cofactor * change).sum(axis=(-2, -1))
            stress = piece.moduli.along(change) + turned
            return self._elements.on_nodes(piece.here, stress), self._elements.on_corners(piece.here, excess)

        return _joined([rate(piece) for piece in self._pieces])


def _joined(parts: list[Forces]) -> Forces:
    forces, volumes = zip(*parts, strict=True)
    return np.concatenate(forces), np.concatenate(volumes)
