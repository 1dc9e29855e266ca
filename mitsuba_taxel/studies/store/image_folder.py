"""Folder of a study of images: one OpenEXR file for each scene, and the tables and pictures that are derived from these
files."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import WriteError, replacing, write_text
from mitsuba_taxel.sensing.camera import RELATIVE_ERRORS, SAMPLES, power_of_four
from mitsuba_taxel.sensing.image_file import read_image, read_image_facts, write_picture
from mitsuba_taxel.sensing.reading.pad_results import PAD_RESULTS, PLATE_RESULTS, REACTION_RESULTS
from mitsuba_taxel.studies.plan.batch import loads_among
from mitsuba_taxel.studies.plan.job import IMAGES, Failure, ImageJob, ImageResult
from mitsuba_taxel.studies.plan.vary import Axis, combinations, make_axes
from mitsuba_taxel.studies.store.dataset import coordinates_of, failure_lines
from mitsuba_taxel.studies.store.folder import STUDY, Store
from mitsuba_taxel.studies.store.opening import read_results

TABLE, SHEET, FLOW, FILM = "images.csv", "contact_sheet", "markers.csv", "film.png"
MOST_ON_SHEET = 64
"""Largest number of images on the contact sheet."""


class ImageStore(Store):
    """The folder of results of a study of images: reads and writes its definition, images and failures."""

    results, suffix = IMAGES, ".exr"

    def keep(self, job: ImageJob, outcome: ImageResult | Failure) -> None:  # type: ignore[override]
        """Store the outcome of a job, which is on disk when this method returns.

        Parameters
        ----------
        job : ImageJob
            The job.
        outcome : ImageResult or Failure
            Its outcome.

        Raises
        ------
        StoreError
            if it cannot be written.
        """
        if isinstance(outcome, Failure):
            super().keep(cast(Any, job), outcome)
            return
        try:
            with replacing(self.file_of(job.number)) as file:
                file.write_bytes(outcome.content)
        except (OSError, WriteError) as error:
            raise self.not_stored(error) from error

    def facts(self, number: int, parameters: Mapping[str, str]) -> dict[str, Any] | None:
        """Facts in the header of the image of a job, with its number of ``samples``; None if the image is missing,
        damaged, or has other parameters.

        Parameters
        ----------
        number : int
            Number of the job.
        parameters : Mapping[str, str]
            Parameters of its scene.

        Returns
        -------
        dict[str, Any] or None
            See `image_of`.
        """
        try:
            facts = read_image_facts(self.file_of(number))
        except InputError:
            return None
        return facts if facts.get("parameters") == dict(parameters) else None


def is_image_study(folder: Path) -> bool:
    """Whether a folder holds a study of images.

    Parameters
    ----------
    folder : Path
        Folder of results.

    Returns
    -------
    bool
        True for a study of images; false for a training set of images, which has no definition of a study.
    """
    return (folder / IMAGES).is_dir() and (folder / STUDY).is_file()


def is_enough(facts: Mapping[str, Any], job: ImageJob) -> bool:
    """Whether a stored image meets the settings of a job.

    Parameters
    ----------
    facts : Mapping[str, Any]
        Facts of the image; see `ImageStore.facts`.
    job : ImageJob
        The job.

    Returns
    -------
    bool
        Whether it does.
    """
    if facts["mesh_size"] != job.mesh_size or facts["variant"] != job.variant:
        return False
    if "relative_total_error" not in facts:  # of an older version
        return False
    if job.target_error is not None:
        error, aimed = facts["relative_total_error"], facts["target_error"]
        return bool((error is not None and error <= job.target_error) or (aimed and aimed <= job.target_error))
    return bool(facts["samples"] >= power_of_four(job.samples or SAMPLES))


def open_images(folder: Path) -> xr.Dataset:
    """Open the table of a study of images, complete or not.

    Parameters
    ----------
    folder : Path
        Folder of results.

    Returns
    -------
    xr.Dataset
        Dataset as `image_table` returns it.

    Raises
    ------
    InputError
        if the folder holds no study of images, or no image yet.
    """
    if not is_image_study(folder):
        raise InputError(f"study {folder} is not allowed: a study of images is needed.")
    study = read_results(folder)
    (scene,), origin = study["scenes"], study["provenance"]
    axes = make_axes(
        scene.get("vary", {}),
        scene.get("together"),
        forces=origin["forces"],
        loads=loads_among(origin["roles"]),
    )
    about = {"scene": Path(scene["scene"]).name, "seed": study["seed"], "target_error": study.get("target_error")}
    return image_table(axes, ImageStore(folder), {**origin, **about})


def image_table(axes: Sequence[Axis], store: ImageStore, about: Mapping[str, Any]) -> xr.Dataset:
    """The images of a study and their numbers, as arrays over its dimensions.

    Parameters
    ----------
    axes : Sequence[Axis]
        Dimensions of the study.
    store : ImageStore
        Its folder.
    about : Mapping[str, Any]
        ``scene``, ``seed``, ``target_error``, ``parameters``, ``units``, ``forces``, ``roles``, ``versions``.

    Returns
    -------
    xr.Dataset
        ``image``, the name of the OpenEXR file in the folder, blank if there is none; ``relative_error`` of a pixel
        due to the light, ``relative_mechanics_error`` and ``relative_total_error``, see `CameraImage`; ``samples`` of
        each pixel and replicate; ``coat_share``, the part of the image that shows the coat; ``white``, its radiance
        that is white in a picture; ``seconds``; and numbers of the deformed pad, such as ``reaction_fz`` in N, with
        their errors, such as ``reaction_fz_error``, NaN if unknown. The attributes are those of `sweep`.

    Raises
    ------
    InputError
        if there is no image yet.
    """
    shape, dims = tuple(axis.size for axis in axes), [axis.dim for axis in axes]
    jobs = dict(enumerate(combinations(axes)))
    facts = {}
    for number in sorted(jobs.keys() & store.done()):
        index, values = jobs[number]
        if kept := store.facts(number, {**about["parameters"], **values}):
            facts[index] = {**kept, "image": f"{IMAGES}/{number:06d}.exr"}
    if not facts:
        raise InputError(f"study {store.folder} holds no image yet: run it first.")
    failures = {
        jobs[number][0]: failure
        for number, failure in store.failures().items()
        if number in jobs and jobs[number][0] not in facts
    }

    # The arrays; numbers that are missing are NaN.
    names = np.full(shape, "", dtype=object)
    numbers: dict[str, np.ndarray] = {}
    for index, kept in facts.items():
        names[index] = kept["image"]
        own = {name: kept.get(name) for name in (*RELATIVE_ERRORS, "samples", "coat_share", "white")}
        own["seconds"] = sum(kept["seconds_by_stage"].values())
        for name, value in kept["pads"].items():
            own |= {name: value, f"{name}_error": kept.get("pad_errors", {}).get(name)}
        for name, value in own.items():
            numbers.setdefault(name, np.full(shape, math.nan))[index] = math.nan if value is None else value
    meanings = {
        "relative_error": ("1", "standard error of a pixel relative to its radiance, root mean square over the coat"),
        "relative_mechanics_error": ("1", "the same of the error by the finite elements"),
        "relative_total_error": ("1", "the same of both errors together"),
        "samples": ("1", "samples of each pixel and replicate"),
        "coat_share": ("1", "part of the image that shows the coat"),
        "white": ("1", "radiance that is white in a picture"),
        "seconds": ("s", "time of computing the image"),
    }
    meanings |= {result.name: (result.unit, result.meaning) for result in (*PAD_RESULTS, *PLATE_RESULTS)}
    meanings |= {result.name: (result.unit, result.meaning) for result in REACTION_RESULTS}
    meanings |= {f"{name}_error": (unit, f"error of {name}, 1 sigma") for name, (unit, _) in meanings.items()}
    words = [meanings[name] for name in numbers]
    notes = []
    if missing := math.prod(shape) - len(facts) - len(failures):
        notes.append(f"{missing} of {math.prod(shape)} scenes have no image yet: the same command computes them")
    for note in sorted({note for kept in facts.values() for note in kept.get("notes", ())}):
        count = sum(note in kept.get("notes", ()) for kept in facts.values())
        notes.append(f"in {count} of {len(facts)} images, {note}")
    errors = np.array([numbers["relative_total_error"][index] for index in facts])
    target, worst, unknown = about["target_error"], float(np.nanmax(errors, initial=0.0)), int(np.isnan(errors).sum())
    if target is not None and worst > target:
        notes.append(f"target error {target:g} not reached: the total error of a pixel is up to {worst:.2g}")
    if target is not None and unknown:
        notes.append(
            f"target error {target:g} not reached: in {unknown} of {len(facts)} images, the error by the finite "
            "elements is unknown"
        )
    return xr.Dataset(
        {
            "image": (dims, names.astype(str), {"long_name": "OpenEXR file of the image"}),
            **{
                name: (dims, values, {"units": unit, "long_name": meaning})
                for (name, values), (unit, meaning) in zip(numbers.items(), words, strict=True)
            },
        },
        coords=coordinates_of(axes, about["units"], about["roles"]),
        attrs={
            **{name: about[name] for name in ("scene", "seed")},
            **{name: json.dumps(about[name]) for name in ("parameters", "versions", "units", "forces", "roles")},
            "notes": "\n".join(notes),
            "failures": "\n".join(failure_lines(axes, failures, about["roles"])),
        },
    )


def write_images(study: xr.Dataset, folder: Path) -> None:
    """Write tables and pictures of a study of images: a PNG file beside each image, the tables ``images.csv`` and, with
    markers, ``markers.csv``, a contact sheet, and ``film.png``, an animated PNG of all images in the order of the
    table.

    All pictures show the same radiance as white, so that they can be compared.

    Parameters
    ----------
    study : xr.Dataset
        Result of `image_table`.
    folder : Path
        Folder of the study.
    """
    from mitsuba_taxel.plots.contact_sheet import plot_contact_sheet
    from mitsuba_taxel.plots.film import write_film

    table = image_rows(study)
    headed = table.rename(columns=headings(study, table))
    head = [f"# {name}: {study.attrs[name]}" for name in ("scene", "parameters", "seed", "versions")]
    head += [f"# {note}" for note in study.attrs["notes"].splitlines()]
    write_text(folder / TABLE, "\n".join(head) + "\n" + headed.to_csv(index=False))

    write_flow(folder, table.image.tolist(), folder / FLOW)

    # Pictures of scenes that were renumbered or have failed since are removed.
    for picture in (folder / IMAGES).glob("[0-9]*.png"):
        picture.unlink()
    white = float(table.white.max())
    places = np.linspace(0, len(table) - 1, min(len(table), MOST_ON_SHEET)).round().astype(int)
    shown = {}
    varied = [str(name) for name in study.coords if study[name].size > 1 and name != "step"]
    for place, (_, row) in enumerate(table.iterrows()):
        image, _ = read_image(folder / row.image)
        write_picture(image, (folder / row.image).with_suffix(".png"), white)
        if place in places:
            values = ((name, row[name]) for name in varied)
            label = ", ".join(f"{name}={value:g}" if _is_number(value) else f"{name}={value}" for name, value in values)
            shown[label or Path(row.image).stem] = image.radiance
    write_film([(folder / image).with_suffix(".png") for image in table.image], folder / FILM)
    columns = study.sizes[study.image.dims[-1]] if len(study.image.dims) > 1 and len(shown) == len(table) else None
    figure = plot_contact_sheet(shown, white, columns)
    with replacing(folder / f"{SHEET}.png") as file:
        figure.savefig(file, format="png", dpi=100)


def write_flow(study: Path, files: Sequence[str], output: Path) -> None:
    """Write the flow of the markers of all images as one table. Nothing is written without markers.

    Parameters
    ----------
    study : Path
        Folder of the study.
    files : sequence of str
        Names of the images in the folder.
    output : Path
        CSV file, with the columns ``image`` and those of `MarkerFlow.columns`.
    """
    flows = {file: read_image(study / file)[0].markers for file in files}
    parts = [pd.DataFrame({"image": file} | flow.columns()) for file, flow in flows.items() if flow is not None]
    output.unlink(missing_ok=True)
    if parts:
        write_text(output, pd.concat(parts).to_csv(index=False))


def image_rows(study: xr.Dataset) -> pd.DataFrame:
    """The images of a study as a table with one row for each image; scenes without an image are omitted.

    Parameters
    ----------
    study : xr.Dataset
        Result of `image_table`.

    Returns
    -------
    pd.DataFrame
        Varied parameters, and all variables of the study.
    """
    table = study.to_dataframe(dim_order=[str(dim) for dim in study.image.dims]).reset_index()
    return table[table.image != ""].reset_index(drop=True)


def headings(study: xr.Dataset, table: pd.DataFrame) -> dict[str, str]:
    """Headings with units, by name, of the columns of `image_rows`.

    Parameters
    ----------
    study : xr.Dataset
        Result of `image_table`.
    table : pd.DataFrame
        Result of `image_rows`.

    Returns
    -------
    dict[str, str]
        Headings of the columns with a unit.
    """
    units = {str(name): study[name].attrs.get("units", "1") for name in table.columns if name in study}
    return {name: f"{name}_{unit}" for name, unit in units.items() if unit != "1"}


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.number))
