"""The step of a load path that strains a pad by about two percent."""

from __future__ import annotations

import math

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.elements import Elements
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.materials.laws import Material

THIN_STEP = 0.125
"""Largest step of an indenter, relative to its thickness: in a larger step it may pass through the surface."""
NATURAL_STRAIN = 0.02
"""Approximate mean strain of one step of a load path."""
TICKS = 64
"""Least number of ticks, the smallest fractions of a step: that of pads that a step strains like a block."""
MOST_TURNED = 0.05
"""Largest displacement gradient that the smallest fraction of a step may cause."""


def natural_step(mesh: VolumeMesh, material: Material, load: Load) -> float:
    """Step of a load path: the change of the load's value that strains the pad by about `NATURAL_STRAIN`.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    material : Material
        Elastic law of the silicone.
    load : Load
        Kind of load.

    Returns
    -------
    float
        Step in N, mm or MPa.
    """
    strained = NATURAL_STRAIN * float(np.ptp(mesh.points[:, 2]))
    if load.moves_plate:
        return strained
    if load.moved_indenter is not None:  # most of the pad is strained less
        return min(2 * strained, THIN_STEP * load.moved_indenter.body.thickness)
    stress = NATURAL_STRAIN * material.youngs_modulus
    return stress if load.follows_surface else stress * load.loaded_area(mesh)


def ticks_of(elements: Elements, response: np.ndarray) -> int:
    """Number of ticks, the shortest intervals between solved states, in a step of a load path: a power of two times
    :data:`TICKS`.

    The step is defined by the strain of a block. Under the same pressure, a plate of side a and thickness t bends about
    (a / t)^3 times as much, so it rotates before it strains. If the linear response of the pad to the usual fraction
    would rotate its silicone too far, fractions are smaller.

    Parameters
    ----------
    elements : Elements
        Elements of the pad.
    response : (N, 3) ndarray
        Change of the displacement with one step to first order, in mm.
    """
    gradient = elements.gradient(slice(None), response)
    turned = float(np.sqrt(np.einsum("mqij,mqij->mq", gradient, gradient).max()))
    return TICKS << max(0, math.ceil(math.log2(max(turned, MOST_TURNED) / (MOST_TURNED * TICKS))))
