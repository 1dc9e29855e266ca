"""The photo-reflector under a mirror plate: Figs. 4 to 6, and the peak of the curve over height."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.interpolate import PchipInterpolator

from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.studies import sweep

LAWS = ("uniform_solid_angle", "uniform_polar_angle", "lambertian")
SPACINGS = (0.6, 0.7, 0.9)
PEAK_SPACINGS = (*(round(0.4 + 0.05 * i, 2) for i in range(11)), 0.94)
PEAK_HEIGHTS = tuple(np.geomspace(0.08, 1.4, 30).round(4).tolist())
PACKAGE = {"x": 1.46, "y": 1.06}
PLATE = 4.0
"""Extent of the plate in mm: a larger one makes no visible difference."""
POINTS = 8192
"""Light paths for each reading and randomisation: far from the peak almost no light returns, so a relative target error
is not useful."""
NEAR_PEAK = 0.8
"""Fraction of the largest reading above which the curve is fitted for its peak."""


class CurveMaximum(NamedTuple):
    """Position of a curve's maximum, with its standard error from the replicates."""

    at: float
    error: float


def heights(store: PaperStudies, workers: int | None) -> dict[float, xr.Dataset]:
    """Fig. 4 by die spacing: readings over height z and emission law.

    At z = 0 the plate lies on the faces and no light passes between them; the first height is one step above.
    """
    vary = {"z": f"{paper.HEIGHT_STEP}:{paper.LARGEST_HEIGHT}:{paper.HEIGHT_STEP}", "law": LAWS}
    return {
        spacing: _sweep(store, f"fig4/spacing_{spacing:g}", vary, {"spacing": spacing}, workers) for spacing in SPACINGS
    }


def edges(store: PaperStudies, axis: str, workers: int | None) -> dict[float, xr.Dataset]:
    """Figs. 5 (``axis`` x) and 6 (y) by die spacing: readings over offset and emission law.

    The plate is at 0.7 mm and extends by ``PLATE`` beyond its edge. The coordinate ``edge`` is the distance of the edge
    from the package's own edge, inwards: at 0 all of the package is covered, at 1.5 mm none is. Along x it uncovers the
    LED first; the response to an edge from the other side is nearly the same, as light meets the mirror half-way
    between LED and phototransistor.
    """
    distances = np.linspace(0, paper.LARGEST_EDGE_DISTANCE, 76)
    offsets = [plate_offset(axis, distance) for distance in distances]
    number = {"x": "fig5", "y": "fig6"}[axis]
    vary = {f"offset_{axis}": offsets, "law": LAWS}
    studies = {}
    for spacing in SPACINGS:
        fixed = {"spacing": spacing, "z": paper.EDGE_HEIGHT, "width": PLATE, "depth": PLATE}
        study = _sweep(store, f"{number}/spacing_{spacing:g}", vary, fixed, workers)
        studies[spacing] = study.assign_coords(edge=(f"offset_{axis}", distances))
    return studies


def plate_offset(axis: str, distance: float) -> float:
    """Position in mm of the plate's centre along an axis, if its edge is ``distance`` inside that of the package."""
    return round(float(distance) + (PLATE - PACKAGE[axis]) / 2, 6)


def peak_heights(store: PaperStudies, workers: int | None) -> xr.Dataset:
    """Readings over height, die spacing and emission law, about the peak."""
    vary = {"z": PEAK_HEIGHTS, "spacing": PEAK_SPACINGS, "law": LAWS}
    return _sweep(store, "peak/readings", vary, {}, workers)


def _sweep(store: PaperStudies, name: str, vary: dict, fixed: dict, workers: int | None) -> xr.Dataset:
    request = {"vary": vary, "defines": fixed, "points": POINTS}
    return store.study(name, request, lambda: sweep("plate.xml", vary, fixed, points=POINTS, workers=workers))


def peak(height: np.ndarray, samples: np.ndarray) -> CurveMaximum:
    """The height at which a smooth curve through readings is largest.

    A cubic in ln(height) is fitted to ln(reading) wherever the mean reading is above 80 % of the largest; the error is
    from the jackknife over replicates, since the peak is a nonlinear function.

    Parameters
    ----------
    height : (H,) ndarray
        Heights in mm, increasing.
    samples : (H, replicates) ndarray
        Readings in W.
    """
    fitted = samples.mean(axis=1) > NEAR_PEAK * samples.mean(axis=1).max()
    if fitted[0] or fitted[-1] or fitted.sum() < 5:
        return CurveMaximum(np.nan, np.nan)
    x, count = np.log(height[fitted]), samples.shape[1]
    total = samples[fitted].sum(axis=1, keepdims=True)
    jackknife = (total - samples[fitted]) / (count - 1)
    curves = np.log(np.concatenate([total / count, jackknife], axis=1))
    positions = np.array([_largest(x, curve) for curve in curves.T])
    spread = positions[1:].std() * np.sqrt(count - 1)
    return CurveMaximum(float(positions[0]), float(spread))


def _largest(x: np.ndarray, y: np.ndarray) -> float:
    curve = np.polynomial.Polynomial.fit(x, y, 3)
    roots = curve.deriv().roots()
    falling = [root.real for root in roots if abs(root.imag) < 1e-9 and curve.deriv(2)(root.real) < 0]
    return float(np.exp(min(falling, key=lambda root: abs(root - x[np.argmax(y)]))))


def peaks(study: xr.Dataset) -> dict[str, dict[float, CurveMaximum]]:
    """Height of the peak for each law and die spacing; NaN if outside the heights."""
    peaks_by_law = {}
    for law in study.law.values:
        curves = study.replicate_power.sel(law=law, taxel=1).transpose("spacing", "z", "replicate")
        peaks_by_law[str(law)] = {
            float(spacing): peak(study.z.values, curve.values)
            for spacing, curve in zip(study.spacing.values, curves, strict=True)
        }
    return peaks_by_law


def spacing_for(peaks_by_spacing: dict[float, CurveMaximum], height: float) -> CurveMaximum:
    """The die spacing with its peak at ``height``, and its error; NaN if there is none in range.

    The root of a monotone cubic through the peaks; its error is that of a nearby peak over the slope there.
    """
    finite = {spacing: position for spacing, position in peaks_by_spacing.items() if np.isfinite(position.at)}
    if len(finite) < 2:
        return CurveMaximum(np.nan, np.nan)
    spacing = np.array(list(finite))
    curve = PchipInterpolator(spacing, [position.at - height for position in finite.values()])
    roots = curve.roots(extrapolate=False)
    if not len(roots):
        return CurveMaximum(np.nan, np.nan)
    root = float(roots[0])
    nearest = finite[float(spacing[np.argmin(np.abs(spacing - root))])]
    return CurveMaximum(root, nearest.error / abs(float(curve.derivative()(root))))


def normalised(study: xr.Dataset, dim: str) -> tuple[xr.DataArray, xr.DataArray]:
    """Readings of taxel 1 over their largest along ``dim``, and the standard error from replicates."""
    samples = study.replicate_power.sel(taxel=1)
    largest = samples.mean("replicate").max(dim)
    shares = samples / largest
    error = xr.apply_ufunc(
        standard_error, shares.transpose("replicate", ...), input_core_dims=[["replicate"]], kwargs={"axis": -1}
    )
    return shares.mean("replicate"), error
