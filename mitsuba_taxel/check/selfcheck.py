"""Quick check of an installation: a reading and a deformation are compared with their exact values."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Check(NamedTuple):
    """Outcome of one check; ``detail`` states what was compared."""

    name: str
    passed: bool
    detail: str


def run_checks() -> list[Check]:
    """Run all checks, in about a second; a check that raises an exception counts as failed.

    Returns
    -------
    list[Check]
        Results in the order of the checks.
    """
    return [_guarded("optics", check_optics), _guarded("mechanics", check_mechanics)]


def _guarded(name: str, check: Callable[[], Check]) -> Check:
    try:
        return check()
    except Exception as error:
        return Check(name, False, f"{type(error).__name__}: {' '.join(str(error).split())}")


def check_optics() -> Check:
    """Check the light: compare the reading under a Lambertian plate at 0.7 mm above a Lambertian LED and a
    phototransistor, 0.7 mm apart, with its exact value.

    The reference is a deterministic quadrature of the single reflection, accurate to 8 digits. The check fails by
    chance once in a million runs.
    """
    from scipy import stats

    from mitsuba_taxel.sensing import Scene, measure

    reference = 0.019702463
    scene = Scene.from_file("plate.xml", z=0.7, spacing=0.7, hole=0, law="lambertian", scattering="lambertian")
    readings = measure(scene, points=4096)
    power, error = float(readings.power[0]), float(readings.standard_error[0])
    passed = abs(power - reference) < stats.t.isf(0.5e-6, len(readings.replicates) - 1) * error < 0.01 * reference
    return Check("optics", bool(passed), f"plate {power:.6f} +- {error:.6f} W, quadrature {reference:.6f} W")


def check_mechanics() -> Check:
    """Check the finite elements: compare the shear x' = x + 0.2 z of one tetrahedron, glued to z = 0 and under
    tractions, with its exact value.

    For a neo-Hookean solid this motion is an exact solution, with the first Piola-Kirchhoff stress
    P = mu (F - I1/3 F^-T) and no pressure.
    """
    from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, TET_EDGES, VolumeMesh
    from mitsuba_taxel.mechanics import NeoHookean
    from mitsuba_taxel.mechanics.elements.assembly import Assembly
    from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
    from mitsuba_taxel.mechanics.elements.solvers import make_solver

    # The mesh: one quadratic tetrahedron, with nodes at its corners and in the middle of its edges.
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.2, 1]])
    points = np.concatenate([corners, [corners[list(edge)].mean(axis=0) for edge in TET_EDGES]])
    middle = {frozenset(edge): 4 + number for number, edge in enumerate(TET_EDGES)}
    triangles = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])
    edges = [[middle[frozenset((face[i], face[j]))] for i, j in FACE_EDGES] for face in triangles.tolist()]
    marks = np.zeros(4, dtype=int)
    mesh = VolumeMesh(points, np.arange(10)[None], np.concatenate([triangles, edges], axis=1), marks, marks.copy())

    # Nodal forces of the exact stress. Shape functions of the mid-edge nodes integrate to a third of a face's area.
    material = NeoHookean()
    gradient = np.array([[1, 0, 0.2], [0, 1, 0], [0, 0, 1]])
    inverse_transpose = np.linalg.inv(gradient).T
    stress = material.shear_modulus * (gradient - (gradient**2).sum() / 3 * inverse_transpose)
    forces = np.zeros((10, 3))
    for face in mesh.faces:
        a, b, c = points[face[:3]]
        forces[face[3:]] += stress @ np.cross(b - a, c - a) / 6

    # Newton's method for the free nodes, and comparison with the exact motion.
    fixed = points[:, 2] == 0
    assembly, solver = Assembly(mesh, material, number_unknowns(mesh, fixed)), make_solver()
    load = np.concatenate([forces[~fixed].ravel(), np.zeros(assembly.numbering.pressures)])
    unknowns = np.zeros(assembly.unknowns)
    for _ in range(8):
        state = assembly.evaluate(*assembly.numbering.split(unknowns))
        assert state.entries is not None, "the element is inverted"
        unknowns -= solver.factor(assembly.matrix(state.entries)).solve(state.residual - load)
    displacement, _ = assembly.numbering.split(unknowns)
    top = float(np.reshape(displacement, (-1, 3))[3, 0])
    passed = bool(np.allclose(np.reshape(displacement, (-1, 3)), points @ (gradient.T - np.eye(3)), atol=1e-9))
    return Check("mechanics", passed, f"sheared element {top:.9f} mm, closed form {0.2:.9f} mm")
