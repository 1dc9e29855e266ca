"""The page of a study as one self-contained HTML file."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import xarray as xr

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.report.page import sections
from mitsuba_taxel.report.page.images import image_sections
from mitsuba_taxel.report.page.markup import paragraph
from mitsuba_taxel.report.page.outcome import outcome_sections
from mitsuba_taxel.report.page.panels import MOST_PANELS, viewer_panels
from mitsuba_taxel.studies import open_study
from mitsuba_taxel.studies.plan.batch import WRITTEN_KEYS, Batch, batch_from
from mitsuba_taxel.studies.store.image_folder import is_image_study
from mitsuba_taxel.studies.store.opening import read_results
from mitsuba_taxel.studies.store.provenance import provenance


@in_turn
def write_report(
    folder: Path, file: Path, progress: Callable[[int, int], None] = lambda done, total: None
) -> list[str]:
    """Write the results in a folder as one self-contained web page.

    Parameters
    ----------
    folder : Path
        Folder of a study of one or several scenes, of a study of images, or output of `taxel tolerance`, `fit`,
        `optimise`, `compare`, `dataset`, `export` or `calibrate`.
    file : Path
        File that ends in ``.html``; replaced when the page is complete.
    progress : Callable[[int, int], None]
        Called with (load steps drawn, total load steps).

    Returns
    -------
    list[str]
        Contents that the page omits, with the reasons.

    Raises
    ------
    InputError
        if the folder contains no results.
    """
    left_out: list[str] = []
    panels: list[dict[str, Any]] = []
    if is_image_study(folder):
        blocks = image_sections(folder)
    else:
        outcome, scenes = outcome_sections(folder), _scenes(folder)
        if not (outcome or scenes):
            open_study(folder)  # raises
        panels = _panels(scenes, folder, left_out, progress)
        blocks = [_missing(scenes), *outcome, _viewer(panels)]
        blocks += [*(block for name, child in scenes.items() for block in _sections(name, child))]
    remarks = [paragraph(f"Left out: {line}", "quiet") for line in left_out]
    title, body = folder.resolve().name, "\n".join([*blocks, *remarks])
    page = Template(_asset("page.html")).substitute(
        title=escape(title),
        style=_asset("page.css"),
        contents=_contents(body),
        body=body,
        solids=json.dumps({"panels": panels}).replace("<", "\\u003c"),
        script=_asset("viewer.js"),
    )
    write_text(file, page)
    return left_out


def _scenes(folder: Path) -> dict[str, xr.Dataset]:
    """Readings of a study by the names of its scenes; empty if the folder contains no study of readings."""
    try:
        study = open_study(folder)
    except InputError:
        return {}
    if isinstance(study, xr.DataTree):
        return {name: child.to_dataset() for name, child in study.children.items()}
    return {"": study}


def _missing(scenes: dict[str, xr.Dataset]) -> str:
    """HTML of a paragraph with the number of jobs without a reading; empty if there are none."""
    readings = [scene.power.isnull().any("taxel") for scene in scenes.values()]
    missing, count = (
        sum(int(is_missing.sum()) for is_missing in readings),
        sum(is_missing.size for is_missing in readings),
    )
    return paragraph(f"Jobs without a reading: {missing} of {count}.") if missing else ""


def _panels(
    scenes: dict[str, xr.Dataset], folder: Path, left_out: list[str], progress: Callable[[int, int], None]
) -> list[dict[str, Any]]:
    """Panels of the viewer for all scenes; contents that cannot be shown are added to ``left_out``."""
    panels: list[dict[str, Any]] = []
    with_pads = sum("mesh" in study for study in scenes.values())
    most_per_scene = max(MOST_PANELS // max(with_pads, 1), 1)
    for name, study in scenes.items():
        if "mesh" not in study:
            left_out.append(
                f"{name or study.attrs['scene']}: the pad in three dimensions, since the study has no meshes."
            )
            continue
        reasons: list[str] = []
        most = min(most_per_scene, MOST_PANELS - len(panels))
        batch = _batch(folder / name, study, reasons) if most else None
        viewer = viewer_panels(study, folder / name, batch, most, reasons, progress)
        left_out += [": ".join(word for word in (name, reason) if word) for reason in reasons]
        for panel in viewer:
            panel["name"] = ": ".join(word for word in (name, panel["name"]) if word)
        panels += viewer
    return panels


def _batch(folder: Path, study: xr.Dataset, left_out: list[str]) -> Batch | None:
    """The batch of a study, from which scenes are loaded; None if the scene file has changed or is missing."""
    about = read_results(folder)
    try:
        batch = batch_from({name: about[name] for name in about if name not in WRITTEN_KEYS}, 0, folder)
        if provenance(batch)["scene_content"] == about["provenance"]["scene_content"]:
            return replace(batch, mesh_size=study.attrs.get("mesh_size"))
        reason = "has been changed since"
    except (InputError, ComputationError) as error:
        reason = f"cannot be loaded: {error}"
    left_out.append(f"light paths and packages, since the scene {study.attrs['scene']} {reason}.")
    return None


def _sections(name: str, study: xr.Dataset) -> list[str]:
    key = f"-{name}" if name else ""
    title = f"What was simulated: {name}" if name else "What was simulated"
    made = [sections.about(study, title, key), sections.power(study, key), sections.merit(study, key)]
    return [*made, sections.cost(study, key)]


def _contents(body: str) -> str:
    """HTML of the table of contents: links to the sections of the page."""
    titles = re.findall(r'<section id="([^"]+)"[^>]*><h2[^>]*>(.*?)</h2>', body)
    return "".join(f'<li><a href="#{name}">{title}</a></li>' for name, title in titles)


def _viewer(panels: list[dict[str, Any]]) -> str:
    if not panels:
        return ""
    options = "".join(f'<option value="{n}">{escape(panel["name"])}</option>' for n, panel in enumerate(panels))
    choice = f'<label>Pad <select data-part="panel">{options}</select></label>' if len(panels) > 1 else ""
    has_light = any("rays" in step for panel in panels for step in panel["steps"])
    rays = (
        '<label class="tick"><input type="checkbox" data-part="rays" checked> Light paths</label>' if has_light else ""
    )
    return Template(_asset("viewer.html")).substitute(choice=choice, rays=rays)


def _asset(name: str) -> str:
    return (files(__package__) / "assets" / name).read_text(encoding="utf-8")
