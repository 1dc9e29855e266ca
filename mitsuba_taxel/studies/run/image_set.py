"""Training sets of images: touches, forces and images of a camera, split into three parts without common touches."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from mitsuba_taxel.base.arguments import as_numbers, check_flags, check_seed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import replacing, write_text
from mitsuba_taxel.base.files.markdown import markdown_table
from mitsuba_taxel.base.left_out import LEFT_OUT
from mitsuba_taxel.base.units import LOADS
from mitsuba_taxel.characterise.roles import roles_of_study
from mitsuba_taxel.mechanics.elements.memory import free_memory
from mitsuba_taxel.sensing.camera import RELATIVE_ERRORS
from mitsuba_taxel.sensing.image_file import read_image
from mitsuba_taxel.studies.plan.files import make_empty_folder
from mitsuba_taxel.studies.plan.job import IMAGES
from mitsuba_taxel.studies.run.training import PARTS, PLACES, check_split, part_by_words
from mitsuba_taxel.studies.store.image_folder import FLOW, headings, image_rows, open_images, write_flow
from mitsuba_taxel.studies.store.netcdf import hdf5_image
from mitsuba_taxel.studies.store.training_files import check_hdf5

OF_FORCE = "reaction_"
"""Beginning of the names of the forces and moments of the indenter on the pad."""
PIXELS = {
    "radiance": ("channel", "units of the lights", "image"),
    "standard_error": ("channel", "units of the lights", "standard error of the radiance by the light, 1 sigma"),
    "mechanics_error": ("channel", "units of the lights", "error of the radiance by the finite elements, 1 sigma"),
    "difference": ("channel", "units of the lights", "image minus that of the unloaded pad"),
    "displacement": ("axis", "mm", "displacement of the coat, NaN beside it"),
    "depth": ("", "mm", "distance of the first surface along the axis of the camera"),
    "coat": ("", "1", "whether the pixel shows the coat"),
    "contact_pressure": ("", "MPa", "force of the indenter per area of the unloaded coat, NaN beside the coat"),
}
"""Third dimension, unit and meaning of the arrays of an image, by name."""


def image_set(
    study: Path, output: Path, *, split: Sequence[float] = (0.7, 0.15, 0.15), seed: int = 0, hdf5: bool = False
) -> dict[str, pd.DataFrame]:
    """Pack a study of images as a training set: a training, validation and test table, and copies of the images.

    Images with the same loads and places of contact belong to the same table, whatever their other parameters are. If
    no load or place is varied, all varied parameters count.

    Parameters
    ----------
    study : Path
        Folder of the study.
    output : Path
        Folder for ``train.csv``, ``validation.csv``, ``test.csv``, the images with their pictures, ``markers.csv`` if
        the coat has markers, and a datasheet, ``README.md``; must be new or empty.
    split : Sequence[float]
        Fractions of the training, validation and test set, each above 0; their sum is 1.
    seed : int
        Seed of the split, from 0 to 2**32 - 1.
    hdf5 : bool
        Whether to write everything as ``dataset.h5`` too: a group for each part, with arrays over row, y and x.

    Returns
    -------
    dict[str, pd.DataFrame]
        Tables ``train``, ``validation`` and ``test`` with a row for each image. Columns: loads, places and other varied
        parameters; forces in N and moments in N mm of the indenter on the pad, with their errors; the errors of a
        pixel, as of `image_table`; and ``image``, the OpenEXR file.

    Raises
    ------
    InputError
        if a value is refused, the study has too few touches, or the folder cannot be written to.
    """
    check_split(split)
    check_seed(seed)
    check_flags(hdf5=hdf5)
    if hdf5:
        check_hdf5()
    images = open_images(study)
    rows, roles = image_rows(images), roles_of_study(images)

    # Touches: the loads and places that are varied, and those that are fixed as further columns.
    touches = {name for name, role in roles.items() if role in (*PLACES, *(name for names in LOADS for name in names))}
    varied = [str(name) for name in images.coords if name != "step"]
    fixed = {name: word for name, word in json.loads(images.attrs["parameters"]).items() if name in touches}
    units = {**json.loads(images.attrs["units"]), **{name: images[name].attrs.get("units", "1") for name in rows}}
    key = [name for name in varied if name in touches] or varied
    words = [" ".join(map(str, row)) for row in rows[key].itertuples(index=False)]
    subset = part_by_words(words, split, seed, "touches")
    for name, word in fixed.items():
        rows[name] = numbers[0] if (numbers := as_numbers([word])) else word
    names = [*fixed, *varied, *(name for name in rows if name.startswith(OF_FORCE)), *RELATIVE_ERRORS, "image"]
    shown = {name: f"{name}_{unit}" for name, unit in units.items() if unit != "1"}
    table = rows[names].rename(columns={**shown, **headings(images, rows)})
    tables = {name: table[subset == number].reset_index(drop=True) for number, name in enumerate(PARTS)}
    for name, part in tables.items():
        if part.empty:
            raise InputError(f"split = {tuple(split)} is not allowed: no image is left for {name}.")
    if hdf5:
        _refuse_large(study, rows.image.tolist())

    # Files: tables, images with their pictures, the datasheet, and the arrays.
    make_empty_folder(output)
    for name, part in tables.items():
        with replacing(output / f"{name}.csv") as file:
            part.to_csv(file, index=False)
    (output / IMAGES).mkdir()
    for image in map(Path, rows.image):
        shutil.copyfile(study / image, output / image)
        if (study / image.with_suffix(".png")).is_file():
            shutil.copyfile(study / image.with_suffix(".png"), output / image.with_suffix(".png"))
    write_flow(study, rows.image.tolist(), output / FLOW)
    write_text(output / "README.md", _datasheet(images, tables, seed))
    if hdf5:
        groups = {name: _group(study, part) for name, part in tables.items()}
        with replacing(output / "dataset.h5") as file:
            file.write_bytes(hdf5_image({"/": xr.Dataset(attrs={"scene": images.attrs["scene"]}), **groups}))
    return tables


def _refuse_large(study: Path, files: Sequence[str]) -> None:
    """Raise `InputError` if the arrays of all images, and their copy as HDF5, do not fit into the free memory."""
    image, _ = read_image(study / files[0])
    arrays = (getattr(image, name) for name in PIXELS)
    needed, free = 3.0 * len(files) * sum(array.nbytes for array in arrays if array is not None), free_memory()
    if needed > free:
        raise InputError(
            f"hdf5 = True is not allowed for {len(files)} images: they need {needed / 2**30:.3g} GiB, and "
            f"{free / 2**30:.3g} GiB are free. The folder of images has the same values."
        )


def _group(study: Path, part: pd.DataFrame) -> xr.Dataset:
    """Columns of a table, and the arrays of its images over row, y and x: the content of one group of an HDF5 file."""
    images = [read_image(study / file)[0] for file in part.image]
    variables = {}
    for heading in part:
        values = part[heading].to_numpy()
        variables[str(heading)] = ("row", values if values.dtype.kind in "fiub" else values.astype(str).astype(object))
    for name, (third, unit, meaning) in PIXELS.items():
        arrays = [getattr(image, name) for image in images]
        if name == "contact_pressure":  # not touched: 0 on the coat
            zero = (np.where(image.coat, np.float32(0), np.float32(np.nan)) for image in images)
            arrays = [rest if own is None else own for own, rest in zip(arrays, zero, strict=True)]
        if any(array is None for array in arrays):
            continue
        stack = np.stack(arrays)
        stack = stack.astype(np.uint8) if stack.dtype == bool else stack
        dims = ("row", "y", "x", *((third,) if third else ()))
        variables[name] = (dims, stack, {"units": unit, "long_name": meaning})  # type: ignore[assignment]
    return xr.Dataset(variables)


def _datasheet(images: xr.Dataset, tables: dict[str, pd.DataFrame], seed: int) -> str:
    """The datasheet of a training set of images, a page in Markdown."""
    about = images.attrs
    fixed = ", ".join(f"{name} = {value}" for name, value in json.loads(about["parameters"]).items())
    versions = ", ".join(f"{name} {value}" for name, value in json.loads(about["versions"]).items())
    everything = pd.concat(tables.values())
    columns = [
        (f"`{name}`", f"{column.min():.4g} to {column.max():.4g}" if pd.api.types.is_numeric_dtype(column) else "")
        for name, column in everything.items()
    ]
    channels = [(f"`{name}`", unit, meaning) for name, (_, unit, meaning) in PIXELS.items()]
    sections = {
        "Where the images come from": "Simulated with mitsuba_taxel: a gel deformed by finite elements, and the light "
        f"behind it, traced by Mitsuba.\n\n- scene {about['scene']} with {fixed or 'no fixed parameters'}; seed of the "
        f"light {about['seed']}\n- versions: {versions}",
        "Columns": markdown_table(("column", "range"), columns),
        "Images": "Each OpenEXR file has, with its channels by colour or axis:\n\n"
        + markdown_table(("array", "unit", "what it is"), channels),
        "Parts": f"Images of one touch belong to the same part; seed of the split {seed}.\n\n"
        + markdown_table(("part", "images"), [(name, str(len(part))) for name, part in tables.items()]),
        "Before you train": f"{LEFT_OUT['training']} The noise of a camera is not part of the images.",
    }
    body = "\n\n".join(f"## {heading}\n{text}" for heading, text in sections.items())
    return f"# Touches and images of {about['scene']}\n\n{body}\n"
