"""Plots of the rerun. Curves are distinguishable with any colour vision, by colour, marker and dash."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.analog import EmulatedSlope
from mitsuba_taxel.evidence.paper.plate import LAWS, CurveMaximum, normalised
from mitsuba_taxel.evidence.paper.scenes import CENTRE, CORNER
from mitsuba_taxel.evidence.paper.slopes import Sensitivity, curves
from mitsuba_taxel.plots.curves import PLACES
from mitsuba_taxel.plots.figures import COLOURS, MARKERS, axes_of, save_small

TICKS = (5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)
DASHES = ("-", "--", ":", "-.")
ABSCISSAE = {"fz": "normal force $F_z$ [N]", "fx": "force along x [N]", "fy": "force along y [N]"}
ABSCISSAE["resultant"] = "force along the diagonal [N]"


@contextmanager
def _figure(file: Path, rows: int, columns: int, size: tuple[float, float], **options: Any) -> Iterator[np.ndarray]:
    """Context manager: axes (rows, columns) of a figure, which is written to ``file`` at the end."""
    axes = axes_of(size, rows, columns, **options)
    yield axes
    save_small(axes[0, 0].figure, file)


def _curves(study: xr.Dataset, path: str) -> tuple[np.ndarray, np.ndarray]:
    """Forces of a load path in N, and readings (forces, taxels) at them."""
    curve = curves(study, path)
    forces = np.linspace(curve.force[0], curve.force[-1], PLACES)
    return forces, curve.power(forces)


def plate_curves(studies: Mapping[float, xr.Dataset], dim: str, abscissa: str, label: str, file: Path) -> None:
    """Plot Figs. 4 to 6 of the paper: normalised power for each emission law, in a panel for each die spacing.

    Parameters
    ----------
    studies : Mapping[float, xr.Dataset]
        Studies by die spacing, with the dimensions ``dim`` and ``law``.
    abscissa : str
        Coordinate on the horizontal axis.
    """
    with _figure(file, 1, len(studies), (11, 3.4), sharey=True) as axes:
        for ax, (spacing, study) in zip(axes[0], studies.items(), strict=True):
            fraction, error = normalised(study, dim)
            for number, law in enumerate(study.law.values):
                y, bar = fraction.sel(law=law), error.sel(law=law)
                style = {"color": COLOURS[number], "linestyle": DASHES[number]}
                ax.plot(study[abscissa], y, label=str(law).replace("_", " "), **style)
                ax.fill_between(study[abscissa].values, y - 2 * bar, y + 2 * bar, color=COLOURS[number], alpha=0.2)
            if dim == "z":
                ax.axvline(paper.PEAK_HEIGHT, color="0.5", linewidth=0.8)
            ax.set_title(f"die spacing {spacing:g} mm", fontsize=10)
            ax.set_xlabel(label)
            ax.grid(alpha=0.3)
        axes[0, 0].set_ylabel("optical power / largest")
        handles = axes[0, 0].get_legend_handles_labels()
        axes[0, 0].figure.legend(*handles, loc="outside upper center", ncols=len(LAWS), frameon=False)


def peak_positions(peaks_by_law: Mapping[str, Mapping[float, CurveMaximum]], file: Path) -> None:
    """Plot the height of the curve's peak against die spacing, for each emission law."""
    with _figure(file, 1, 1, (6, 4)) as axes:
        ax = axes[0, 0]
        for number, (law, peaks) in enumerate(peaks_by_law.items()):
            position, error = np.array([[peak.at, peak.error] for peak in peaks.values()]).T
            style = {"color": COLOURS[number], "linestyle": DASHES[number], "marker": MARKERS[number]}
            ax.errorbar(list(peaks), position, error, label=law.replace("_", " "), markersize=4, capsize=2, **style)
        ax.axhline(paper.PEAK_HEIGHT, color="0.5", linewidth=0.8, label="datasheet's peak")
        ax.set_xlabel("die spacing [mm]")
        ax.set_ylabel("height of the peak [mm]")
        ax.grid(alpha=0.3)
        ax.legend(frameon=False)


def normal_curves(studies: Mapping[str, xr.Dataset], file: Path) -> None:
    """Plot Fig. 9 of the paper for all cell shapes: power of the nine taxels against normal force."""
    with _figure(file, 2, 2, (10, 7), sharex=True) as axes:
        for ax, (cell, study) in zip(axes.flat, studies.items(), strict=True):
            forces, smooth = _curves(study, "fz")
            for number, taxel in enumerate(study.taxel.values):
                reading, style = study.sel(taxel=taxel), {"color": COLOURS[number], "linestyle": DASHES[number // 3]}
                ax.plot(forces, smooth[:, number], linewidth=0.8, label=str(taxel), **style)
                marks = {"color": COLOURS[number], "marker": MARKERS[number], "linestyle": "none", "markersize": 3}
                ax.errorbar(
                    study.fz.values, reading.power.values, reading.standard_error.values, elinewidth=0.6, **marks
                )
            ax.set_title(cell, fontsize=10)
            ax.grid(alpha=0.3)
        for ax in axes[:, 0]:
            ax.set_ylabel("optical power [W]")
        for ax in axes[-1]:
            ax.set_xlabel(ABSCISSAE["fz"])
            ax.locator_params("x", nbins=5)
        axes[0, 0].invert_xaxis()
        axes[0, -1].figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside right center", title="taxel")


def tangential_curves(
    nominal: Mapping[str, Mapping[str, xr.Dataset]], beyond: Mapping[str, Mapping[str, xr.Dataset]] | None, file: Path
) -> None:
    """Plot the change of power of a corner taxel and the centre taxel against tangential force, at -8 N.

    Curves beyond the paper's limits are dashed. They start at the change reached there, because their meshes may be
    coarser."""
    paths = ("fx", "fy", "resultant")
    with _figure(file, len(paths), len(nominal), (12, 8), sharex=True) as axes:
        for column, (cell, studies) in enumerate(nominal.items()):
            for row, path in enumerate(paths):
                ax = axes[row, column]
                runs = [(studies[path], "-"), *([(beyond[cell][path], "--")] if beyond else [])]
                last_change = 0.0
                for study, dash in runs:
                    forces, power = _curves(study, path)
                    change = last_change + power - power[0]
                    last_change = change[-1]
                    for number, taxel in enumerate((CORNER, CENTRE)):
                        style = {"color": COLOURS[number], "linestyle": dash, "linewidth": 0.9}
                        label = f"taxel {taxel}" if dash == "-" else None
                        ax.plot(forces, change[:, taxel - 1], label=label, **style)
                ax.grid(alpha=0.3)
                ax.ticklabel_format(axis="y", style="sci", scilimits=(-2, 2))
                ax.set_xlabel(ABSCISSAE[path])
            axes[0, column].set_title(cell, fontsize=10)
        for ax in axes[:, 0]:
            ax.set_ylabel("change of power [W]")
        axes[0, 0].legend(frameon=False)


def diagonal_maps(nominal: Mapping[str, Mapping[str, xr.Dataset]], roofs: Mapping[str, xr.Dataset], file: Path) -> None:
    """Plot Fig. 10 of the paper: displacement of the roofs and change of the powers by 8 N along the secondary
    diagonal, at -8 N."""
    with _figure(file, 2, len(nominal), (12, 5.4)) as axes:
        for column, (cell, studies) in enumerate(nominal.items()):
            tops = 1e3 * (roofs[cell].diagonal - roofs[cell].normal).values
            power = curves(studies["resultant"], "resultant").power(np.array([0.0, paper.SHOWN_TANGENTIAL_FORCE]))
            change = 1e6 * (power[1] - power[0])
            for row, (values, unit) in enumerate(((tops, "µm"), (change, "µW"))):
                ax, largest = axes[row, column], np.abs(values).max()
                image = ax.imshow(values.reshape(3, 3), cmap="PuOr", vmin=-largest, vmax=largest)
                for taxel, value in enumerate(values):
                    dark = abs(value) > 0.6 * largest
                    words = f"{taxel + 1}\n{value:+.0f}"
                    ax.text(taxel % 3, taxel // 3, words, ha="center", va="center", color="w" if dark else "k")
                ax.figure.colorbar(image, ax=ax, label=unit, shrink=0.8)
                ax.set(xticks=[], yticks=[])
            axes[0, column].set_title(cell, fontsize=10)
        axes[0, 0].set_ylabel("rise of the roof [µm]")
        axes[1, 0].set_ylabel("change of power [µW]")


def sensitivities(
    ours: Mapping[str, Mapping[str, Sensitivity]], expected: Mapping[str, Mapping[str, EmulatedSlope]], file: Path
) -> None:
    """Plot Table 1: sensitivities of the paper, sensitivities of this program, and those that 60 000 counted rays would
    give.

    Parameters
    ----------
    ours, expected : Mapping[str, Mapping[str, Sensitivity]] and Mapping[str, Mapping[str, EmulatedSlope]]
        Sensitivities of this program and of counted rays, by ``normal`` and ``tangential``, then by cell shape.
    """
    theirs = {"normal": paper.NORMAL, "tangential": paper.TANGENTIAL}
    with _figure(file, 1, 2, (10, 4), sharey=True) as axes:
        for ax, (kind, values) in zip(axes[0], theirs.items(), strict=True):
            x = np.arange(len(paper.CELLS))
            slopes = [ours[kind][cell] for cell in paper.CELLS]
            counts = [expected[kind][cell] for cell in paper.CELLS]
            rows = (
                ("paper", list(values.values()), [0.0] * len(x)),
                ("here", [result.max_slope for result in slopes], [result.max_slope_error for result in slopes]),
                ("60 000 counted rays", [result.mean for result in counts], [result.spread for result in counts]),
            )
            for number, (label, y, bar) in enumerate(rows):
                positions = x + 0.15 * (number - 1)
                style = {"color": COLOURS[number], "marker": MARKERS[number], "linestyle": "none", "capsize": 3}
                ax.errorbar(positions, 1e6 * np.array(y), 1e6 * np.array(bar), label=label, **style)
            ax.set_xticks(x, paper.CELLS, fontsize=8)
            ax.set_yscale("log")
            ax.set_yticks(TICKS, [f"{tick:g}" for tick in TICKS])
            ax.minorticks_off()
            ax.set_title(f"{kind} force", fontsize=10)
            ax.grid(alpha=0.3)
        axes[0, 0].set_ylabel("maximum slope [µW/N]")
        axes[0, 0].legend(frameon=False)


def choices(tables: Mapping[str, Mapping[str, Mapping[str, Sensitivity]]], file: Path) -> None:
    """Plot the normal and tangential sensitivities of the four cell shapes under each choice (rows), and those of the
    paper.

    Parameters
    ----------
    tables : Mapping[str, Mapping[str, Mapping[str, Sensitivity]]]
        Sensitivities by choice, then ``normal`` and ``tangential``, then cell shape.
    file : Path
        File of the figure.
    """
    theirs = {"normal": paper.NORMAL, "tangential": paper.TANGENTIAL}
    rows, ticks = np.arange(len(tables)), (10, 100, 1000, 10_000)
    with _figure(file, 1, 2, (11, 0.32 * len(tables) + 1.8), sharey=True) as axes:
        for ax, kind in zip(axes[0], theirs, strict=True):
            for number, cell in enumerate(paper.CELLS):
                results = [table[kind][cell] for table in tables.values()]
                x = 1e6 * np.array([result.max_slope for result in results])
                bar = 1e6 * np.array([result.max_slope_error for result in results])
                style = {"color": COLOURS[number], "marker": MARKERS[number], "linestyle": "none", "markersize": 4}
                ax.errorbar(x, rows + 0.15 * (number - 1.5), xerr=bar, label=cell, **style)
                ax.axvline(1e6 * theirs[kind][cell], color=COLOURS[number], linestyle=DASHES[number], linewidth=0.9)
            ax.set_xscale("log")
            ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks], fontsize=8)
            ax.minorticks_off()
            ax.set_title(f"{kind} force (lines: paper)", fontsize=10)
            ax.set_xlabel("steepest slope [µW/N]")
            ax.grid(alpha=0.3)
        axes[0, 0].set_yticks(rows, list(tables))
        axes[0, 0].invert_yaxis()
        handles = axes[0, 0].get_legend_handles_labels()
        axes[0, 0].figure.legend(*handles, loc="outside upper center", ncols=len(paper.CELLS), frameon=False)


def repetitions(
    counted: Mapping[str, np.ndarray], drawn: Mapping[str, np.ndarray], true: Mapping[str, float], file: Path
) -> None:
    """Plot the maximum slopes of the centre taxel in repetitions of the paper's procedure, and the true maximum slope.

    Parameters
    ----------
    counted, drawn : Mapping[str, ndarray]
        Maximum slopes in W/N by cell shape, from repetitions with counted rays and from binomial counts.
    true : Mapping[str, float]
        True maximum slopes in W/N, by cell shape.
    """
    with _figure(file, 2, 2, (10, 6)) as axes:
        for ax, (cell, slopes) in zip(axes.flat, counted.items(), strict=True):
            edges = np.histogram_bin_edges(1e6 * np.concatenate([slopes, drawn[cell]]), 20)
            ax.hist(1e6 * slopes, edges, density=True, color=COLOURS[4], label="counted rays")
            ax.hist(1e6 * drawn[cell], edges, density=True, histtype="step", color=COLOURS[0], label="binomial counts")
            ax.axvline(1e6 * paper.NORMAL[cell], color=COLOURS[1], linestyle="--", label="paper")
            ax.axvline(1e6 * true[cell], color=COLOURS[2], linestyle=":", label="true")
            ax.set_xlim(0)
            ax.set_title(cell, fontsize=10)
            ax.set_yticks([])
        for ax in axes[-1]:
            ax.set_xlabel("maximum slope over 0.5 N [µW/N]")
        axes[0, 0].legend(frameon=False)
