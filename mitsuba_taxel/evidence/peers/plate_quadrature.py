"""Reference value for the Lambertian plate: power on the phototransistor by quadrature."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.evidence.peers.cases import DETECTOR, LED_SIDE


def plate_power(z: float, spacing: float = 0.7, side: float = 4.0, panels: int = 80, exponent: float = 1) -> float:
    """Power on the phototransistor in W per W emitted, for a Lambertian LED and one reflection at a Lambertian plate of
    reflectance 1.

    The fraction of the light from a point of the plate that reaches a parallel rectangle is the configuration factor F,
    which has a closed form. By reciprocity, F also gives the irradiance at this point. The power is therefore the
    integral of F_led F_detector over the plate, divided by the area of the LED. It is computed by composite
    Gauss-Legendre quadrature with 8 x 8 nodes per panel.

    Parameters
    ----------
    z : float
        Height of the plate above the LED's plane, mm.
    spacing : float
        Distance between the centres of LED and phototransistor, along x, mm.
    side : float
        Side of the plate, mm.
    panels : int
        Number of panels along each side of the plate.
    exponent : float
        Power of the cosine in the phototransistor's response to a parallel beam; 1 if ideal.
    """
    nodes, weights = np.polynomial.legendre.leggauss(8)
    step = side / panels
    middle = -0.5 * side + step * (np.arange(panels) + 0.5)
    x = (middle[:, None] + 0.5 * step * nodes).ravel()
    w = np.tile(0.5 * step * weights, panels)
    led = configuration_factor(x[:, None] + 0.5 * spacing, x, LED_SIDE, LED_SIDE, z)
    position = (x[:, None] - 0.5 * spacing, x)
    ideal = exponent == 1
    detector = (
        configuration_factor(*position, *DETECTOR, z) if ideal else response_factor(*position, *DETECTOR, z, exponent)
    )
    return float(w @ (led * detector) @ w / LED_SIDE**2)


def configuration_factor(x, y, width: float, depth: float, z: float):
    """Configuration factor from a surface element at the height z, facing down, to a rectangle centred at the origin,
    facing up.

    It is a signed sum, over the corners of the rectangle, of the closed form for an element below a corner (J. R.
    Howell, A Catalog of Radiation Configuration Factors, B-3).

    Parameters
    ----------
    x, y : ndarray
        Positions of the element, mm, which are broadcast against each other.
    width, depth : float
        Sides of the rectangle along x and y, mm.
    z : float
        Height of the element, mm.
    """
    signs = [(sx, sy) for sx in (-1, 1) for sy in (-1, 1)]
    return sum(sx * sy * _to_corner((sx * 0.5 * width - x) / z, (sy * 0.5 * depth - y) / z) for sx, sy in signs)


def response_factor(x, y, width: float, depth: float, z: float, exponent: float) -> np.ndarray:
    """Configuration factor as :func:`configuration_factor`, with light weighted by cos**(exponent - 1), by
    Gauss-Legendre quadrature with 20 x 20 nodes.

    Parameters
    ----------
    x, y, width, depth, z
        See :func:`configuration_factor`.
    exponent : float
        Power of the cosine in the response.
    """
    nodes, weights = np.polynomial.legendre.leggauss(20)
    total = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)))
    for node_x, weight_x in zip(nodes, weights, strict=True):
        for node_y, weight_y in zip(nodes, weights, strict=True):
            square = (x - 0.5 * width * node_x) ** 2 + (y - 0.5 * depth * node_y) ** 2 + z**2
            total += weight_x * weight_y * (z**2 / square) ** (0.5 * (exponent + 1)) / square
    return total * 0.25 * width * depth / np.pi


def _to_corner(a, b) -> np.ndarray:
    p, q = np.sqrt(1 + a**2), np.sqrt(1 + b**2)
    return (a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * np.pi)
