"""`taxel dataset`: a finished study as tables for training a calibration model."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import debug_option, folder_option, json_option, seed_option


def _shares(ctx: click.Context, param: click.Parameter, value: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in value.split(","))
    except ValueError:
        problem = f"{value!r} is not of the form 0.7,0.15,0.15: three fractions are needed."
        raise click.BadParameter(problem, ctx, param) from None


@click.command(short_help="Training, validation and test tables of a study.")
@click.argument("study", type=click.Path(path_type=Path), metavar="DIR")
@folder_option
@click.option(
    "--noise", default="0", show_default=True, metavar="SIGMA",
    help="Gaussian noise of the light of every reading: 1 sigma in W, or relative to the reading, such as 0.5%. "
    "With a circuit, voltages have its noise as well.",
)  # fmt: skip
@click.option(
    "--copies", type=click.IntRange(min=1), default=1, show_default=True, help="Noisy copies of each job of the study."
)
@click.option(
    "--split", default="0.7,0.15,0.15", show_default=True, metavar="SHARES", callback=_shares,
    help="Fractions of the training, validation and test set; their sum is 1.",
)  # fmt: skip
@seed_option
@click.option("--parquet", is_flag=True, help="Also write the tables as Parquet; needs pyarrow.")
@click.option("--hdf5", is_flag=True, help="Also write all tables as dataset.h5, with units; needs h5netcdf.")
@click.option(
    "--lerobot", is_flag=True, help="Also write the folder lerobot, in the layout of LeRobot 3.0; needs pyarrow."
)
@json_option
@debug_option
def command(
    study: Path,
    folder: Path,
    noise: str,
    copies: int,
    split: tuple[float, ...],
    seed: int,
    parquet: bool,
    hdf5: bool,
    lerobot: bool,
    as_json: bool,
) -> None:
    """Write force and readings of the study in DIR as train.csv, validation.csv and test.csv, with a datasheet.

    For a study with a circuit, the tables also have voltages and counts. All rows of one force go into the same table.
    For a study of images, the tables have the touches, the forces and moments, and the files of the images. The folder
    for the results must be empty or new.
    """
    from mitsuba_taxel.studies.store.image_folder import is_image_study

    if is_image_study(study):
        from mitsuba_taxel.base.errors import InputError

        others = {"--noise": noise != "0", "--copies": copies > 1, "--parquet": parquet, "--lerobot": lerobot}
        for name in (name for name, given in others.items() if given):
            raise InputError(f"{name} is not allowed for images of a camera, only for readings.")
        _pack_images(study, folder, split, seed, hdf5, as_json)
        return
    from mitsuba_taxel.studies import open_study
    from mitsuba_taxel.studies.run.training import training_set
    from mitsuba_taxel.studies.store.datasheet import rows_line

    from ..tables import print_json

    tables = training_set(
        open_study(study),
        folder,
        noise=noise,
        copies=copies,
        split=split,
        seed=seed,
        parquet=parquet,
        hdf5=hdf5,
        lerobot=lerobot,
    )
    rows = {name: len(table) for name, table in tables.items()}
    if as_json:
        print_json({"output": str(folder), "rows": rows})
        return
    click.echo(rows_line(rows))
    click.echo(f"Results: {folder}")


def _pack_images(study: Path, folder: Path, split: tuple[float, ...], seed: int, hdf5: bool, as_json: bool) -> None:
    """Write the training set of a study of images, and print the numbers of its rows."""
    from mitsuba_taxel.studies.run.image_set import image_set
    from mitsuba_taxel.studies.store.datasheet import rows_line

    from ..tables import print_json

    rows = {name: len(table) for name, table in image_set(study, folder, split=split, seed=seed, hdf5=hdf5).items()}
    if as_json:
        print_json({"output": str(folder), "rows": rows})
        return
    click.echo(rows_line(rows))
    click.echo(f"Results: {folder}")
