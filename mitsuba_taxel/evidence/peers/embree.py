"""Light tracing with next-event estimation, written in numpy for this comparison, with ray intersections by Embree
(`embreex`); one thread."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_taxel.evidence.peers.cases import DETECTOR, LED_SIDE, Estimator, PeerCase
from mitsuba_taxel.pads import REGIONS

BATCH = 1 << 16
CLEARANCE = 1e-5  # mm, of a new ray from the surface that it leaves


@dataclass(frozen=True)
class Triangles:
    """Triangles of a whole scene, their normals, and whether each triangle reflects (with reflectance 1) or absorbs."""

    embree: Any
    mesh: Any  # Embree keeps no reference to it
    normals: np.ndarray
    reflects: np.ndarray
    centres: np.ndarray  # (T, 3) midway between LED and phototransistor of each taxel
    half_spacing: float
    isotropic: bool


def prepare(case: PeerCase) -> Estimator:
    """Return a function that estimates the readings of a case by light tracing, on the triangles of the loaded scene.
    Rays are not traced by Mitsuba."""
    case.require_ideal()
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    triangles, reflects, centres, spacing = _triangles(case)
    scene = EmbreeScene()
    mesh = TriangleMesh(scene, triangles.astype(np.float32))
    first, second, third = triangles.swapaxes(0, 1)
    normals = np.cross(second - first, third - first)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    geometry = Triangles(scene, mesh, normals, reflects, centres, 0.5 * spacing, case.isotropic)

    def estimate(samples: int, seed: int) -> np.ndarray:
        rng = np.random.default_rng(seed)
        power = np.zeros(len(centres))
        for start in range(0, samples, BATCH):
            count = min(BATCH, samples - start)
            for taxel in range(len(centres)):
                power[taxel] += _trace(geometry, taxel, count, rng)
        return power / samples

    return estimate


def _triangles(case: PeerCase) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """N triangles (N, 3, 3) of a case, a mask (N,) of those that reflect, the centres (T, 3) of T taxels, and the die
    spacing; all lengths in mm."""
    scene = case.load("taxel_tracer")
    triangles, reflects = [], []
    for shape in scene.shapes():
        faces = np.array(shape.faces_buffer()).reshape(-1, 3)
        triangles.append(np.array(shape.vertex_positions_buffer(), dtype=float).reshape(-1, 3)[faces])
        if np.all(shape.has_attribute("face_region")):
            reflects.append(np.array(shape.attribute_buffer("face_region")) == REGIONS["roof"])
        else:
            reflects.append(np.full(len(faces), case.single_bounce and not shape.is_emitter()))
    led = np.array(scene.emitters()[0].faces.centres).T
    detector = np.array(scene.sensors()[0].faces.centres).T
    return np.concatenate(triangles), np.concatenate(reflects), 0.5 * (led + detector), float((detector - led)[0, 0])


def _trace(geometry: Triangles, taxel: int, count: int, rng: np.random.Generator) -> float:
    """Trace ``count`` light paths of a taxel. Returns the sum of their powers on the phototransistor, per W emitted."""
    # Start at random points of the LED, in directions by the cosine law.
    centre = geometry.centres[taxel]
    origin = centre + np.column_stack([(rng.random((count, 2)) - 0.5) * LED_SIDE, np.full(count, CLEARANCE)])
    origin[:, 0] -= geometry.half_spacing
    direction = _hemisphere(np.tile((0.0, 0, 1), (count, 1)), rng, isotropic=False)
    total = 0.0
    # Trace until all paths are absorbed or lost; at each reflection, connect to the phototransistor.
    while len(origin):
        hit = geometry.embree.run(origin.astype(np.float32), direction.astype(np.float32), query="INTERSECT", output=1)
        triangle = hit["primID"]
        alive = (triangle >= 0) & geometry.reflects[triangle]
        triangle, direction = triangle[alive], direction[alive]
        point = origin[alive] + hit["tfar"][alive, None] * direction
        normal = geometry.normals[triangle]
        normal *= -np.sign(np.einsum("ij,ij->i", normal, direction))[:, None]
        origin = point + CLEARANCE * normal
        total += _connect(geometry, centre, origin, normal, rng)
        direction = _hemisphere(normal, rng, geometry.isotropic)
    return total


def _connect(geometry: Triangles, centre, origin, normal, rng: np.random.Generator) -> float:
    """Power that travels directly from ``origin`` to a random point of the phototransistor; 0 if it is occluded."""
    target = centre + np.column_stack([(rng.random((len(origin), 2)) - 0.5) * DETECTOR, np.zeros(len(origin))])
    target[:, 0] += geometry.half_spacing
    direction = target - origin
    distance = np.linalg.norm(direction, axis=1)
    direction /= distance[:, None]
    cosine_out = np.einsum("ij,ij->i", normal, direction)
    value = (
        np.where(geometry.isotropic, 0.5, cosine_out)
        / np.pi
        * -direction[:, 2]
        / distance**2
        * DETECTOR[0]
        * DETECTOR[1]
    )
    visible = (cosine_out > 0) & (direction[:, 2] < 0)
    origin, direction, distance = origin[visible], direction[visible], distance[visible] - CLEARANCE
    limit = distance.astype(np.float32)
    blocked = geometry.embree.run(
        origin.astype(np.float32), direction.astype(np.float32), dists=limit, query="OCCLUDED"
    )
    return float(value[visible][blocked < 0].sum())


def _hemisphere(normal: np.ndarray, rng: np.random.Generator, isotropic: bool) -> np.ndarray:
    """Random unit vectors in the hemispheres around the normals, distributed uniformly (``isotropic``) or by the cosine
    law."""
    sphere = rng.standard_normal(normal.shape)
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    if isotropic:
        return sphere * np.copysign(1, np.einsum("ij,ij->i", sphere, normal))[:, None]
    direction = sphere + normal
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)
