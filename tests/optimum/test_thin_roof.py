"""A wide cell below a thin roof, which bends like a clamped plate: its most sensitive height in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from plate_reference import DETECTOR, LED, plate_power
from scipy.optimize import minimize_scalar

from mitsuba_taxel.optimum import optimise

CELL, THINNEST, SPACING = 6.0, 0.6, 0.9
LEVEL = 0.5
"""Height in mm of LED and phototransistor above the board."""
SCENE = f"""<scene version="3.9.0">
    <default name="fz" value="0"/> <default name="cell_height" value="1.2"/> <default name="height" value="1.85"/>
    <shape type="deformable_pad">
        <integer name="rows" value="1"/> <integer name="columns" value="1"/> <float name="mesh_size" value="2.5"/>
        <float name="cell_size" value="{CELL}"/> <float name="wall" value="1"/> <float name="pitch" value="8"/>
        <float name="cell_height" value="$cell_height"/> <float name="height" value="$height"/>
        <float name="poisson_ratio" value="0.3"/> <vector name="force" value="0, 0, $fz"/>
        <bsdf type="region">
            <bsdf name="roof" type="wall"> <string name="scattering" value="lambertian"/> </bsdf>
        </bsdf>
    </shape>
    <shape type="photo_reflector">
        <float name="spacing" value="{SPACING}"/> <sensor type="phototransistor"/>
        <emitter type="annular_led"> <string name="law" value="lambertian"/> <float name="hole" value="0"/> </emitter>
    </shape>
</scene>"""
STUDY = f"""
scene = "cell.xml"
[optimise]
maximise = "sensitivity"
evaluations = 4
[optimise.variables]
cell_height = [1.1, 1.5]
height = [1.7, 2.1]
[optimise.loads]
normal = {{ fz = [0, -0.02] }}
[[optimise.constraints]]
figure = "least_wall"
least = {THINNEST}
"""


def clamped_plate(half, terms=4):
    """Deflection of a clamped square plate under unit pressure, times its bending stiffness, and slopes by x and y.

    By the method of W. Ritz, in (1 - x^2)^2 x^2i (1 - y^2)^2 y^2j.
    """
    shapes = [Polynomial([1, 0, -1]) ** 2 * Polynomial([0, 0, 1]) ** power for power in range(terms)]

    def over(one):
        return one.integ()(1) - one.integ()(-1)

    bend = [[[over(p.deriv(a) * q.deriv(b)) for q in shapes] for p in shapes] for a, b in ((0, 0), (0, 2), (2, 2))]
    still, mixed, curved = np.array(bend)
    stiffness = np.kron(curved, still) + np.kron(still, curved) + np.kron(mixed, mixed.T) + np.kron(mixed.T, mixed)
    load = np.array([over(shape) for shape in shapes])
    found = np.linalg.solve(stiffness, np.kron(load, load)).reshape(terms, terms) * half**4

    def deflection(x, y):
        rows, columns = ([shape(place / half) for shape in shapes] for place in (x, y))
        return np.einsum("ij,i...,j...->...", found, rows, columns)

    def slope(x, y):
        rows, columns = [shape.deriv()(x / half) / half for shape in shapes], [shape(y / half) for shape in shapes]
        return np.einsum("ij,i...,j...->...", found, rows, columns)

    return deflection, slope, lambda x, y: slope(y, x)


def form_factor(points, normal, centre, size):
    """From elements at ``points`` to a rectangle at (``centre``, 0, 0), along its outline (J. H. Lambert, 1760),
    times the length of the normals."""
    corners = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*size, 0] + [centre, 0, 0]
    to = corners[:, None] - points
    to /= np.linalg.norm(to, axis=2, keepdims=True)
    across = np.cross(to, np.roll(to, -1, axis=0))
    sine = np.linalg.norm(across, axis=2)
    angle = np.arctan2(sine, (to * np.roll(to, -1, axis=0)).sum(axis=2))
    outline = ((angle / sine)[..., None] * across).sum(axis=0)
    return np.abs((outline * normal).sum(axis=1)) / (2 * np.pi)


def bent_power(z, pressure, plate):
    """Power in W by way of a Lambertian roof that bends down from the height ``z``, by quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    edges = np.linspace(-0.5 * CELL, 0.5 * CELL, 17)
    half = 0.5 * (edges[1] - edges[0])
    x, y = (each.ravel() for each in np.meshgrid(*2 * [((edges[1:, None] - half) + half * nodes).ravel()]))
    area = np.outer(*2 * [np.tile(half * weights, 16)]).ravel()
    down, by_x, by_y = (pressure * each(x, y) for each in plate)
    points, normal = np.column_stack([x, y, z - down]), np.column_stack([-by_x, -by_y, -np.ones(len(x))])
    lit = form_factor(points, normal, -0.5 * SPACING, LED) / np.prod(LED)
    responses = form_factor(points, normal / np.linalg.norm(normal, axis=1, keepdims=True), 0.5 * SPACING, DETECTOR)
    return area @ (lit * responses)


def test_the_most_sensitive_height_below_a_thin_roof(tmp_path):
    """The thinnest roof, and the height at which light changes most with the deflection of a clamped plate: the closed
    form is within 0.1 % of its best there."""
    plate = clamped_plate(0.5 * CELL)
    assert plate[0](0.0, 0.0) / CELL**4 == pytest.approx(0.00126, rel=5e-3)  # S. P. Timoshenko, 1959, table 35
    assert bent_power(1.1, 0.0, plate) == pytest.approx(plate_power(1.1, spacing=SPACING, side=CELL), rel=1e-6)

    def change(z, step=1e-6):
        return abs(bent_power(z, step, plate) - bent_power(z, -step, plate)) / (2 * step)

    truth = minimize_scalar(lambda z: -change(z), bounds=(0.6, 1.0), method="bounded")
    (tmp_path / "cell.xml").write_text(SCENE)
    (tmp_path / "study.toml").write_text(STUDY)
    found = optimise(tmp_path / "study.toml", tmp_path / "out").variables.set_index("variable").best
    assert found.height - found.cell_height == pytest.approx(THINNEST, abs=1e-6)
    assert change(found.cell_height - LEVEL) > (1 - 1e-3) * -truth.fun
    assert found.cell_height - LEVEL == pytest.approx(truth.x, rel=0.02)  # walls give way as well
