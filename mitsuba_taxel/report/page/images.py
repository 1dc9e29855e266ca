"""Sections of the page of a study of images: what was simulated, pictures, a table, errors and times."""

from __future__ import annotations

import base64
import math
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.report.page import sections
from mitsuba_taxel.report.page.markup import bullets, paragraph, section, table
from mitsuba_taxel.sensing.camera import RELATIVE_ERRORS
from mitsuba_taxel.studies.store.image_folder import FILM, SHEET, TABLE, image_rows, open_images

PICTURES = {
    f"{SHEET}.png": "Images under their values; all have the same white.",
    FILM: "All images in the order of the table.",
}
"""Captions of the pictures of a study, by file."""
ERRORS = dict(zip(RELATIVE_ERRORS, ("light", "finite elements", "total"), strict=True))
"""Headings of the errors of an image."""


def image_sections(folder: Path) -> list[str]:
    """HTML sections of a study of images.

    Parameters
    ----------
    folder : Path
        Folder of the study.

    Returns
    -------
    list[str]
        Sections: what was simulated, the images, and errors and times.

    Raises
    ------
    InputError
        if the folder holds no study of images, or no image yet.
    """
    study = open_images(folder)
    rows = image_rows(study).to_dict("records")
    return [_about(study, len(rows)), _images(study, rows, folder), _cost(rows)]


def _about(study: xr.Dataset, images: int) -> str:
    varied = [
        f"{name}: {sections.span(study[name].values, study[name].attrs.get('units', ''))}"
        for name in study.coords
        if study[name].dims and name != "step"
    ]
    lines = [
        f"Scene {study.attrs['scene']}; {sections.count(images, 'image')}; seed {study.attrs['seed']}.",
        *([f"Varied: {'; '.join(varied)}."] if varied else []),
        *study.attrs["notes"].splitlines(),
    ]
    failures = study.attrs["failures"].splitlines()
    failed = f'<div class="failed">{paragraph("Failed:")}{bullets(failures)}</div>' if failures else ""
    return section("about", "What was simulated", bullets(lines), failed, *sections.provenance(study))


def _images(study: xr.Dataset, rows: list[dict[str, Any]], folder: Path) -> str:
    pictures = [
        f'<figure><img class="plot" src="data:image/png;base64,'
        f'{base64.b64encode((folder / name).read_bytes()).decode("ascii")}" alt="{escape(caption)}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
        for name, caption in PICTURES.items()
        if (folder / name).is_file()
    ]
    keys = [str(name) for name in study.coords if study[name].size > 1 and name != "step"]
    numbers = [str(name) for name in study.data_vars if f"{name}_error" in study]
    headings = [_heading(study, name) for name in keys] + [f"{words} [%]" for words in ERRORS.values()]
    cells = [
        [
            *(sections.word(row[name]) for name in keys),
            *(_percent(row[name]) for name in ERRORS),
            *(with_error(row[name], row[f"{name}_error"]) for name in numbers),
            row["image"],
        ]
        for row in rows[: sections.MOST_ROWS]
    ]
    omitted = sections.left_out(len(rows), f"{TABLE} holds")
    caption = f"Images: errors of a pixel, root mean square over the coat, and forces and moments{omitted}"
    headings += [*(_heading(study, name) for name in numbers), "file"]
    return section("images", "Images", *pictures, table(caption, headings, cells))


def _cost(rows: list[dict[str, Any]]) -> str:
    worst = []
    for name, words in ERRORS.items():
        values = np.array([row[name] for row in rows], dtype=float)
        unknown = int(np.isnan(values).sum())
        known = _percent(float(np.nanmax(values, initial=-math.inf))) if unknown < len(values) else ""
        worst.append((words, known, str(unknown) if unknown else ""))
    seconds = sum(row["seconds"] for row in rows)
    return section(
        "cost",
        "Error and time",
        table("Largest error of a pixel, root mean square over the coat", ("source", "error [%]", "unknown in"), worst),
        paragraph(f"Time of all images, summed over processes: {seconds:.4g} s."),
    )


def _heading(study: xr.Dataset, name: str) -> str:
    unit = study[name].attrs.get("units", "1")
    return name.replace("_", " ") + (f" [{unit}]" if unit not in ("", "1") else "")


def _percent(value: float) -> str:
    """A relative error in percent; unknown errors are blank."""
    return "" if math.isnan(value) else f"{100 * value:.2g}"
