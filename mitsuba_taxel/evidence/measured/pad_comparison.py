"""Comparison of the measured pad with its model, which is fitted to one taxel and predicts the others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.evidence.measured import bench_pad, measured
from mitsuba_taxel.evidence.measured.bench_pad import IndenterPress
from mitsuba_taxel.evidence.measured.pad_fit import FittedPad, PressedTaxel, fit
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies

INDENTER, START = "sphere", (8.0, 1.15)
"""End of the rod; first guess of height and radius in mm. Beside much smaller radii the elements are too large for the
deepest travels."""
PREDICTED_TRAVELS = (0.15, 0.3, 0.6, 1.2, 1.65, 1.8, 2.05, 2.1)
"""Travels in mm for the predicted taxels, up to the largest measured force."""
MAP_TRAVEL = 1.6
"""Travel in mm of the computed map. With an indenter beside the middle, load paths may end before the travel of the
hold."""
FINER = 1.05
"""Size in mm of smaller elements, on which the hold of the fitted pad is computed again."""


class TaxelComparison(NamedTuple):
    """A taxel that is pressed by the indenter: measured and computed curve at the S measured travels; NaN beyond the
    end of the computed load path.

    Attributes
    ----------
    measured, computed : PressedTaxel
        Forces in N and changes of the reading; computed forces are those with the fitted modulus.
    along : PressedTaxel
        The computed curve at many travels, for plots.
    change_at_force : (S,) ndarray
        Computed change at the measured forces.
    end : str
        Reason why the computed load path ends early; empty if it does not.
    """

    measured: PressedTaxel
    computed: PressedTaxel
    along: PressedTaxel
    change_at_force: np.ndarray
    end: str

    @property
    def force_error(self) -> np.ndarray:
        """Error (S,) of the computed force at equal travel, in percent of the largest measured force."""
        return 100 * (self.computed.force - self.measured.force) / self.measured.force.max()

    @property
    def change_error(self) -> np.ndarray:
        """Error (S,) of the computed change of the reading at equal force, in percent of the largest measured change.
        """
        return 100 * (self.change_at_force - self.measured.change) / self.measured.change.max()


class NeighbourChange(NamedTuple):
    """Changes while the middle taxel is held: height of the pad in mm, mean change of the four nearest taxels in
    percent of that of the middle taxel, and relative change of the middle taxel."""

    height: float
    near: float
    held: float


class PadComparison(NamedTuple):
    """The fitted model of the pad, and its predictions for all taxels.

    Attributes
    ----------
    found : FittedPad
        The fitted height, modulus and indenter.
    taxels : dict[int, TaxelComparison]
        Comparison for each pressed taxel, by its number.
    offset : (2,) ndarray
        Offset (x, y) of the indenter from the middle in mm, from the asymmetry of the measured map.
    centred, moved : (5, 5) ndarray
        Computed changes of all taxels while the middle taxel is held, in percent of the change of the middle taxel,
        with the indenter in the middle and with the offset.
    held : float
        Relative change of the middle taxel while it is held.
    errors : xr.Dataset
        Force and changes at the travel of the hold, with their errors.
    finer : xr.Dataset
        Force and changes at the travel of the hold, on smaller elements.
    widest : NeighbourChange
        Result of the pad height, among those tried, whose map agrees best with the measured map at the four taxels
        nearest to the middle.
    """

    found: FittedPad
    taxels: dict[int, TaxelComparison]
    offset: np.ndarray
    centred: np.ndarray
    moved: np.ndarray
    held: float
    errors: xr.Dataset
    finer: xr.Dataset
    widest: NeighbourChange

    @property
    def fitted(self) -> IndenterPress:
        """The fitted pad, and the fitted indenter in the middle."""
        return _press_of(self.found)


def results(store: PaperStudies) -> PadComparison:
    """Fit the model to taxel 13, and predict all other taxels; missing load paths are computed."""
    curves = {taxel: measured_curve(taxel) for taxel in measured.PRESSES}

    def pressed(height: float, radius: float) -> PressedTaxel:
        return curve_of(bench_pad.path(store, IndenterPress(height, INDENTER, radius)), measured.PRESSED)

    fitted_pad = fit(pressed, curves[measured.PRESSED], START)
    fitted = _press_of(fitted_pad)
    studies = {taxel: predicted_path(store, fitted, taxel) for taxel in curves}
    compared = {taxel: compare(studies[taxel], taxel, fitted_pad, curve) for taxel, curve in curves.items()}
    hold_travel = (fitted_pad.travel(measured.HELD_AT),)
    errors = bench_pad.path(store, fitted, hold_travel, with_errors=True)
    finer = bench_pad.path(store, fitted, hold_travel, mesh_size=FINER)
    centred = held_map(errors)
    offset = offset_from(centred, np.array(measured.HELD_MAP))
    moved_study = bench_pad.path(store, fitted.moved(*offset.tolist()), (fitted_pad.travel(MAP_TRAVEL),))
    tried = [_wide(bench_pad.path(store, IndenterPress(h, INDENTER, r)), h) for h, r in fitted_pad.tried]
    measured_ring = ring(np.array(measured.HELD_MAP), 1)
    widest = min(tried, key=lambda wide: abs(wide.near - measured_ring))
    change = float(errors.change.sel(taxel=measured.PRESSED).item())
    return PadComparison(
        found=fitted_pad,
        taxels=compared,
        offset=offset,
        centred=centred,
        moved=held_map(moved_study),
        held=change,
        errors=errors,
        finer=finer,
        widest=widest,
    )


def predicted_path(store: PaperStudies, fitted: IndenterPress, taxel: int) -> xr.Dataset:
    """Compute the load path of the fitted pad with the indenter above the middle of a taxel."""
    if taxel == measured.PRESSED:
        return bench_pad.path(store, fitted)
    return bench_pad.path(store, fitted.moved(*bench_pad.centre_of(taxel)), PREDICTED_TRAVELS)


def pressed_at(store: PaperStudies, fitted: IndenterPress, taxel: int, place: np.ndarray, travel: float) -> xr.Dataset:
    """Compute the fitted pad with the indenter at a place (x, y) relative to the middle of a taxel, at one travel in
    mm."""
    x, y = np.round(np.add(bench_pad.centre_of(taxel), place), 3).tolist()
    return bench_pad.path(store, fitted.moved(x, y), (travel,))


def _press_of(fitted_pad: FittedPad) -> IndenterPress:
    return IndenterPress(float(fitted_pad.unknowns[0]), INDENTER, float(fitted_pad.unknowns[1]))


def _wide(study: xr.Dataset, height: float) -> NeighbourChange:
    hold = study.sel(travel=[measured.HELD_AT])
    return NeighbourChange(height, ring(held_map(hold), 1), float(hold.change.sel(taxel=measured.PRESSED).item()))


def measured_curve(taxel: int) -> PressedTaxel:
    """The measured curve of a taxel; changes are relative to its voltage at rest."""
    press = measured.PRESSES[taxel]
    return PressedTaxel(np.array(press.travels), np.array(press.forces), np.array(press.volts) / press.at_rest)


def curve_of(study: xr.Dataset, taxel: int) -> PressedTaxel:
    return PressedTaxel(study.travel.values, study.force.values, study.change.sel(taxel=taxel).values)


def compare(study: xr.Dataset, taxel: int, fitted_pad: FittedPad, measured_taxel: PressedTaxel) -> TaxelComparison:
    """Compare the computed load path of a pressed taxel with its measured curve."""
    computed = curve_of(study, taxel)
    travels = np.linspace(0.0, computed.travel[-1], 200)
    along, at_measured = (computed.at(travel) for travel in (travels, measured_taxel.travel + fitted_pad.late))
    along, at_measured = (
        curve._replace(travel=curve.travel - fitted_pad.late, force=fitted_pad.modulus * curve.force)
        for curve in (along, at_measured)
    )
    change = np.interp(measured_taxel.force, along.force, along.change, right=np.nan)
    return TaxelComparison(measured_taxel, at_measured, along, change, study.attrs["end"])


def held_map(study: xr.Dataset) -> np.ndarray:
    """Map (5, 5) of the changes of all taxels at the last travel, in percent of the change of the middle taxel."""
    change = study.change.isel(travel=-1).values
    return 100 * (change / change[measured.PRESSED - 1]).reshape(bench_pad.SIDE, bench_pad.SIDE)


def offset_from(centred: np.ndarray, measured_map: np.ndarray) -> np.ndarray:
    """Offset (x, y) of the indenter from the middle in mm, from the asymmetry of the measured map at the nearest
    taxels.

    The asymmetry under a centred indenter, due to the dies beside the axes of the cells, is subtracted. The changes are
    assumed to depend on the distance r from the indenter only. The slope of their logarithm at one pitch converts the
    asymmetry to an offset. It is computed from an even polynomial of degree 4 in r through the computed changes at 0, 1
    and 2 pitches."""
    first_ring, second_ring = ring(centred, 1), ring(centred, 2)
    a, b = np.linalg.solve([[1.0, 1.0], [4.0, 16.0]], np.log([first_ring / 100.0, second_ring / 100.0]))
    slope = first_ring * (2 * a + 4 * b) / measured.PITCH
    asymmetry = measured_map * first_ring / ring(measured_map, 1) - centred
    middle = bench_pad.SIDE // 2
    along_x = asymmetry[middle, middle + 1] - asymmetry[middle, middle - 1]
    along_y = asymmetry[middle - 1, middle] - asymmetry[middle + 1, middle]
    return np.round(-np.array([along_x, along_y]) / (2 * slope), 2)


def ring(values: np.ndarray, steps: int) -> float:
    """Mean of a map over the four taxels at ``steps`` pitches from the middle, along the row and the column."""
    middle = bench_pad.SIDE // 2
    before, after = middle - steps, middle + steps
    return float(
        np.mean([values[middle, before], values[middle, after], values[before, middle], values[after, middle]])
    )
