"""The photo-reflector under a mirror plate: Figs. 4 to 6 of the paper, and the peak of the reading over height."""

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
"""Extent of the plate in mm; a larger plate makes no visible difference."""
POINTS = 8192
"""Light paths for each reading and randomisation: far from the peak almost no light returns, so a relative target error
is not useful."""
NEAR_PEAK = 0.8
"""Fraction of the largest reading above which the curve is fitted for its peak."""


class CurveMaximum(NamedTuple):
    """Position of a curve's maximum in mm, and its standard error from the replicates."""

    at: float
    error: float


def heights(store: PaperStudies, workers: int | None) -> dict[float, xr.Dataset]:
    """Compute the studies of Fig. 4, by die spacing: readings over the height z of the plate and the emission law.

    At z = 0, the plate lies on the dies and no light passes between them; the first height is one step above.
    """
    vary = {"z": f"{paper.HEIGHT_STEP}:{paper.LARGEST_HEIGHT}:{paper.HEIGHT_STEP}", "law": LAWS}
    return {
        spacing: _sweep(store, f"fig4/spacing_{spacing:g}", vary, {"spacing": spacing}, workers) for spacing in SPACINGS
    }


def edges(store: PaperStudies, axis: str, workers: int | None) -> dict[float, xr.Dataset]:
    """Compute the studies of Fig. 5 (``axis`` x) or Fig. 6 (y), by die spacing: readings over the offset of the plate
    and the emission law.

    The plate is at a height of 0.7 mm, and extends by ``PLATE`` from its edge. The coordinate ``edge`` is the distance
    of the plate's edge from the edge of the package, inwards: at 0 the whole package is covered, at 1.5 mm nothing of
    it. Along x, the LED is uncovered first. An edge from the other side has nearly the same effect, because light hits
    the mirror half-way between LED and phototransistor.
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
    """Position in mm of the plate's centre along an axis, if the plate's edge is ``distance`` mm inside the edge of the
    package."""
    return round(float(distance) + (PLATE - PACKAGE[axis]) / 2, 6)


def peak_heights(store: PaperStudies, workers: int | None) -> xr.Dataset:
    """Compute readings over height, die spacing and emission law, for heights around the peak."""
    vary = {"z": PEAK_HEIGHTS, "spacing": PEAK_SPACINGS, "law": LAWS}
    return _sweep(store, "peak/readings", vary, {}, workers)


def _sweep(store: PaperStudies, name: str, vary: dict, fixed: dict, workers: int | None) -> xr.Dataset:
    request = {"vary": vary, "defines": fixed, "points": POINTS}
    return store.study(name, request, lambda: sweep("plate.xml", vary, fixed, points=POINTS, workers=workers))


def peak(height: np.ndarray, samples: np.ndarray) -> CurveMaximum:
    """Find the height at which a smooth curve through readings has its maximum.

    A cubic polynomial in ln(height) is fitted to ln(reading) where the mean reading is above 80 % of the largest. The
    error is from the jackknife over replicates, because the position of the peak is a nonlinear function of the
    readings.

    Parameters
    ----------
    height : (H,) ndarray
        H increasing heights in mm.
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
    """Height of the peak for each emission law and die spacing; NaN if it is outside the range of heights."""
    peaks_by_law = {}
    for law in study.law.values:
        curves = study.replicate_power.sel(law=law, taxel=1).transpose("spacing", "z", "replicate")
        peaks_by_law[str(law)] = {
            float(spacing): peak(study.z.values, curve.values)
            for spacing, curve in zip(study.spacing.values, curves, strict=True)
        }
    return peaks_by_law


def spacing_for(peaks_by_spacing: dict[float, CurveMaximum], height: float) -> CurveMaximum:
    """Find the die spacing whose peak is at ``height`` mm, and its error; NaN if there is none in the range of
    spacings.

    The result is the root of a monotone cubic interpolation of the peaks. Its error is that of a neighbouring peak
    divided by the slope at the root.
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
    """Readings of taxel 1 divided by their maximum along ``dim``, and their standard errors from the replicates."""
    samples = study.replicate_power.sel(taxel=1)
    largest = samples.mean("replicate").max(dim)
    shares = samples / largest
    error = xr.apply_ufunc(
        standard_error, shares.transpose("replicate", ...), input_core_dims=[["replicate"]], kwargs={"axis": -1}
    )
    return shares.mean("replicate"), error
