"""Contact models with second-order terms, written to files. Balls and rods are solved in full until the error of the
model reaches a target."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable
from dataclasses import fields
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from mitsuba_taxel.base.arguments import check_flags, is_number, is_whole, path_of, refusal
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.files.atomic import replacing, write_text
from mitsuba_taxel.base.left_out import LEFT_OUT
from mitsuba_taxel.surrogates.contact_fit import contact_model
from mitsuba_taxel.surrogates.contact_jax import jax_of_contact
from mitsuba_taxel.surrogates.contact_onnx import onnx_of_contact
from mitsuba_taxel.surrogates.contact_readings import BEYOND, ContactModel, LearntErrors, SecondOrder
from mitsuba_taxel.surrogates.contact_states import SolvedTouch, StateFile, Touch, solved_touch, touches
from mitsuba_taxel.surrogates.onnx_model import check_onnx
from mitsuba_taxel.surrogates.second_order import with_second_order

if TYPE_CHECKING:
    from mitsuba_taxel.sensing import Scene

FIRST, FURTHER, MOST = 8, 4, 40
"""Number of bodies that are solved first, then each time while the error is too large, and at most."""
ENDINGS = (".npz", ".onnx", ".py")
FORMAT = 3
"""Version of the file format. Version 1 had other second-order terms, and version 2 no largest features of contact."""
UNITS = {
    "x": "mm, centres of the columns",
    "y": "mm, centres of the rows, descending",
    "size": "mm, of a patch along x and y",
    "height": "mm, of the undeformed top above the board",
    "covered": "whether a patch lies on the top",
    "compliance": "mm/N, mean displacement of a covered patch by a force on each, row by row",
    "rest": "W, readings at rest, row by row from (-x, +y)",
    "gradient": "W/N, by the force on each covered patch",
    "largest_depth": "mm",
    "places": "mm, lowest and highest centre of pressure, x and y",
    "lateral": "mm/N, mean displacement of a covered patch along x and y by a force on each",
    "tangential": "mm/N, mean displacement of a covered patch along x and y by a force along x and y on each",
    "tangential_gradient": "W/N, by the force along x and y on each covered patch",
    "second_reading": "1, of a constant, the relative change, depth over height, and force by mean compliance over it",
    "second_force": "1, of a constant, depth over height, root of area over it, and depth by distance² over its cube",
    "second_largest": "1, largest features of the force in the fit: one, and the three of second_force",
    "second_side": "1, ratio of the tangential force to that of the slope of bodies",
}
"""Arrays of a file, with their units."""
OF_FILES = ("lateral", "tangential", "tangential_gradient")
"""Arrays that only .npz files have."""
STATUS = (
    "0 within the range of the model, otherwise a sum of 1 for a depth that is not a number, 2 for one beyond that of "
    "the model, 4 for a centre of pressure beyond its places, 8 for contact of few patches, 16 for contact that was "
    f"not solved, 32 for given forces that pull, and 64 for contact beyond {BEYOND:g} times the largest features of "
    "the fit, or with a factor of the forces that is not above 0; results with 1 and 16 are NaN"
)
"""Meaning of the status of a touch, for the file."""


def export_contact(
    scene: Scene,
    file: str | Path,
    depth: float,
    *,
    error: float = 0.01,
    spacing: float | None = None,
    mesh_size: float | None = None,
    most: int = MOST,
    friction: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ContactModel, list[str]]:
    """Write a contact model of a scene's pad, for bodies of any shape, with its error on bodies that were left out of
    its fit.

    The model predicts readings and forces from the depth of a body below the top, which is divided into a grid of
    rectangles (patches), each with one force and one mean displacement.

    The linear model is that of :func:`contact_model`. Second-order terms are fitted to full solutions (finite
    elements and light) of balls and rods at positions and depths within its range. More bodies are solved until the
    readings of left-out bodies are predicted to ``error``. Solved states are stored in a file beside the model, so
    that the same call resumes an interrupted run.

    Parameters
    ----------
    scene : Scene
        A scene with one elastic pad at rest, whose top is a plane, and diffuse cells.
    file : str or Path
        Output file, whose name ends in ``.npz``, ``.onnx`` or ``.py``, as of :func:`write_contact_model`.
    depth : float
        Largest depth in mm.
    error : float
        Target for the error of the readings, root mean square relative to their largest change.
    spacing, mesh_size : float, optional
        Sides of the patches, and size of the finite elements in mm; see :func:`contact_model`.
    most : int
        Largest number of bodies.
    friction : bool
        Whether the model has tangential compliances, for `FrictionPads`; this needs an ``.npz`` file.
    progress : Callable[[int, int], None], optional
        Called with (patches or bodies done, all of them).

    Returns
    -------
    model : ContactModel
        Contents of the file.
    notes : list[str]
        Sentences on the errors of the model, and on the sources of error that they do not contain.

    Raises
    ------
    InputError
        if the scene has no such model, or a value is not allowed.
    ComputationError
        if too few bodies can be solved, as where a roof touches its package before the depth is reached.
    """
    file = _model_file(file)
    check_flags(friction=friction)
    if friction and file.suffix != ".npz":
        raise refusal("friction", friction, f"models in {file.suffix} have no friction: a .npz file is needed")
    if not (is_number(error) and 0 < error < 1):
        raise refusal("error", error, "a number above 0 and below 1 is needed")
    if not (is_whole(most) and most >= FIRST):
        raise refusal("most", most, f"a whole number of bodies of at least {FIRST} is needed")
    model = contact_model(
        scene, depth, spacing=spacing, mesh_size=mesh_size, friction=friction, progress=progress
    )
    states = StateFile(file.with_suffix(".states.json"), model)
    solve = _solver(scene)

    # More bodies, until those left out are predicted well enough.
    solved, failed = list[SolvedTouch](), list[str]()
    count, learnt = 0, model
    while count < most:
        further = touches(model, most)[count : count + (FURTHER if count else FIRST)]
        for touch in further:
            result = states.of(touch, solve)
            solved, failed = (solved, [*failed, result]) if isinstance(result, str) else ([*solved, result], failed)
            count += 1
            if progress is not None:
                progress(count, most)
        if len(solved) >= FIRST:
            learnt = with_second_order(model, solved)
            assert learnt.errors is not None
            if learnt.errors.reading_rms <= error:
                break
    if learnt.errors is None:
        raise ComputationError(
            f"only {len(solved)} of {count} bodies could be solved to depths of up to {depth:g} mm: a smaller depth is "
            f"needed. The last one failed: {failed[-1]}"
        )
    write_contact_model(learnt, file, {"scene": scene.name, "parameters": dict(scene.parameters)})
    return learnt, contact_notes(learnt, error, failed)


def _solver(scene: Scene) -> Callable[[Touch], SolvedTouch]:
    """Create a function that solves the contact of a body in full, by finite elements and light. The scene is loaded at
    its first call.
    """
    from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells

    loaded = list[DiffuseCells]()

    def solve(touch: Touch) -> SolvedTouch:
        if not loaded:
            loaded.append(DiffuseCells(scene.load()))
        return solved_touch(loaded[0], touch)

    return solve


def contact_notes(model: ContactModel, error: float, failed: list[str]) -> list[str]:
    """Sentences on the errors of a contact model.

    Parameters
    ----------
    model : ContactModel
        A model with second-order terms.
    error : float
        Target for the error of the readings.
    failed : list[str]
        Reasons why bodies could not be solved.

    Returns
    -------
    list[str]
        Sentences.
    """
    errors = model.errors
    assert errors is not None
    notes = [
        f"readings: error {errors.reading_rms:.2%} of full scale (at worst {errors.reading_worst:.2%}), on "
        f"{errors.bodies} balls and rods, {errors.states} states, left out one by one",
        f"force: error {errors.force_rms:.2%} of {errors.force_full_scale:.3g} N (at worst {errors.force_worst:.2%}), "
        "with its tangential part, that of bodies without friction",
        f"moments about x and y: error {errors.moment_rms:.2g} N mm",
        "errors of the finite elements are not included; the largest force and the largest change of each taxel are "
        "full scale, so that light touches have larger relative errors",
    ]
    if failed:
        notes.append(f"{len(failed)} bodies could not be solved and are left out; the last one: {failed[-1]}")
    if errors.reading_rms > error:
        notes.append(
            f"the target of {error:.2%} is not reached: smaller patches (spacing) or a smaller depth reduce the error"
        )
    return [*notes, LEFT_OUT["model"]]


def write_contact_model(model: ContactModel, file: str | Path, about: dict[str, Any] | None = None) -> None:
    """Write a contact model, with its units and errors.

    An ``.npz`` file of `numpy` has units and errors as JSON in its array ``about``, and can be read again. An ``.onnx``
    file has the input ``depth`` and the outputs of :class:`ContactReadings`, with units and errors as metadata. A
    ``.py`` file needs JAX and numpy alone: its function ``read`` can be differentiated.

    Parameters
    ----------
    model : ContactModel
        The model.
    file : str or Path
        Output file, whose name ends in ``.npz``, ``.onnx`` or ``.py``.
    about : dict, optional
        Further entries of ``about``, such as the name of the scene.

    Raises
    ------
    InputError
        if the name has another ending, or onnx is needed and not installed.
    ComputationError
        if the iteration of the ``.onnx`` or ``.py`` file does not converge for this pad.
    """
    file = _model_file(file)
    arrays: dict[str, Any] = {
        name.name: np.asarray(getattr(model, name.name))
        for name in fields(model)
        if name.name not in ("second", "errors", *OF_FILES)
    }
    if file.suffix == ".npz":
        arrays |= {name: getattr(model, name) for name in OF_FILES if getattr(model, name) is not None}
    if model.second is not None:
        arrays |= {f"second_{name}": np.asarray(values) for name, values in model.second._asdict().items()}
    text = {
        "format": FORMAT,
        "units": {name: UNITS[name] for name in arrays},
        "input": "depth map (rows, columns) in mm: how far bodies reach below the undeformed top at each patch centre",
        "status": STATUS,
        "errors": None if model.errors is None else model.errors._asdict(),
        "errors_leave_out": LEFT_OUT["model"],
        "version": version("mitsuba_taxel"),
        **(about or {}),
    }
    if file.suffix == ".npz":
        with replacing(file) as temporary, temporary.open("wb") as stream:
            np.savez_compressed(stream, about=np.array(json.dumps(text)), **arrays)
    elif file.suffix == ".onnx":
        # The grid and the ranges of the input are metadata, too: a runtime does not show constants.
        names = ("x", "y", "size", "height", "largest_depth", "places", "second_largest")
        ranges = {name: arrays[name].tolist() for name in names if name in arrays}
        entries = {name: value if isinstance(value, str) else json.dumps(value) for name, value in text.items()}
        content = onnx_of_contact(model, {**entries, "ranges": json.dumps(ranges)})
        with replacing(file) as temporary:
            temporary.write_bytes(content)
    else:
        write_text(file, jax_of_contact(model, arrays, text))


def read_contact_model(file: str | Path) -> ContactModel:
    """Read a contact model from its file.

    Parameters
    ----------
    file : str or Path
        File of :func:`write_contact_model` or ``taxel export --contact``.

    Returns
    -------
    ContactModel
        The model.

    Raises
    ------
    InputError
        if there is no such file, or it is of another kind or a later version.
    """
    path = path_of("file", file)
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            arrays: dict[str, Any] = {name: content[name] for name in content.files}
        about = json.loads(str(arrays.pop("about")))
        later, earlier = about["format"] > FORMAT, about["format"] < FORMAT
    except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile, zlib.error) as error:
        raise InputError(f"{path} is no contact model: a file of taxel export --contact is needed.") from error
    if later:
        raise InputError(f"{path} is of a later version of the format ({about['format']}): a newer program is needed.")
    if earlier:
        raise InputError(f"{path} is of an earlier version of the format: export it again.")
    try:
        second = None
        if "second_reading" in arrays:
            own = {name: arrays.pop(f"second_{name}") for name in SecondOrder._fields}
            second = SecondOrder(**own | {"side": float(own["side"])})
        width, depth = arrays.pop("size").tolist()
        scalars: dict[str, Any] = {name: float(arrays.pop(name)) for name in ("height", "largest_depth")}
        errors = None if about["errors"] is None else LearntErrors(**about["errors"])
        return ContactModel(size=(width, depth), second=second, errors=errors, **scalars, **arrays)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is no complete contact model: export it again.") from error


def origin_of(file: Path) -> dict[str, Any]:
    """Name and parameters of the scene from which a contact model was made, if its file states them.

    Parameters
    ----------
    file : Path
        An ``.npz`` file that `read_contact_model` has read.

    Returns
    -------
    dict
        Entries for ``about`` of `write_contact_model`.
    """
    with np.load(file, allow_pickle=False) as content:
        about = json.loads(str(content["about"]))
    return {name: about[name] for name in ("scene", "parameters") if name in about}


def _model_file(file: str | Path) -> Path:
    """Path of the output file; raises `InputError` for an unknown extension."""
    path = path_of("file", file)
    if path.suffix not in ENDINGS:
        raise refusal("file", str(path), "a name that ends in .npz, .onnx or .py is needed")
    if path.suffix == ".onnx":
        check_onnx()
    return path
