"""A polynomial as an ONNX graph of a few operations, with its box, units and error as metadata."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.atomic import replacing
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.left_out import LEFT_OUT
from mitsuba_taxel.base.printed import Printed, as_json, from_json
from mitsuba_taxel.base.units import in_percent
from mitsuba_taxel.electronics import Circuit, respond, saturated_words
from mitsuba_taxel.electronics.pieces import straight_pieces
from mitsuba_taxel.electronics.response import lit
from mitsuba_taxel.electronics.volts import circuit_of_study
from mitsuba_taxel.surrogates.calibration import Calibration
from mitsuba_taxel.surrogates.polynomial import MOST_DEGREE, Polynomial, Unseen, polynomial_of, single
from mitsuba_taxel.surrogates.wording import printed_calibration, printed_model

_Step = tuple[str, list[str], str, dict[str, Any]]

OPSET, IR = 18, 8
"""Versions of ONNX supported by runtimes since 2023."""
TARGET = 0.01
"""Relative to full scale: a larger error gives a note."""
ROUNDING = 1e-9
"""Relative to the box: inputs this little outside are inside, such as an unloaded pad of 1e-12 N."""
PRINTED = "printed"
"""Key of the metadata with what the command prints."""
BEYOND = 2.0
"""Largest power of a circuit's pieces, relative to the largest of the study; the last piece goes on."""


def export(study: xr.Dataset | xr.DataTree, file: str | Path) -> tuple[Polynomial, list[str]]:
    """Write a model of a study's readings that needs nothing but an ONNX runtime.

    Its input ``inputs`` (rows, inputs) has the varied parameters; its outputs are ``readings`` (rows, taxels) in W and
    ``inside`` (rows,), whether the inputs lie in the box covered by the study. Beyond it the readings are those at its
    edge. Of a study with a circuit there are also ``voltage`` in V and ``counts``, both (rows, taxels): the circuit's
    response to these readings, in straight pieces. The metadata contain names, units and ranges of the inputs, the
    test error, that of the study itself and both together, scene, parameters and versions.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        As returned by ``open_study``, of one scene.
    file : str or Path
        Must end in ``.onnx``.

    Returns
    -------
    model : Polynomial
        What the file holds.
    notes : list[str]
        Its errors, and what it leaves out.

    Raises
    ------
    InputError
        if onnx is not installed, or the study has several scenes, varied words or too few values.
    """
    check_onnx()
    study = single(study)
    found = polynomial_of(study)
    about = {
        "inputs": json.dumps(list(found.names)),
        "units": json.dumps(list(found.units)),
        "low": json.dumps(found.low.tolist()),
        "high": json.dumps(found.high.tolist()),
        "readings": "optical power in W per taxel, row by row from (-x, +y)",
        "error": json.dumps({"rms": found.rms, "worst": found.worst, "of": "full scale", "tested": found.tested}),
        "errors_leave_out": LEFT_OUT["model"],
        **{name: str(study.attrs[name]) for name in ("scene", "parameters", "seed", "points", "versions")},
    }
    own = study_error(study)
    about["study_error"] = json.dumps({"rms": known(own.rms), "worst": known(own.worst), "of": "full scale"})
    total = float(np.hypot(found.rms, own.rms))
    about["total_error"] = json.dumps({"rms": known(total), "of": "full scale"})
    notes = [
        f"error of the study's own readings (light, finite elements, surfaces): {in_percent(own.rms)} of full scale "
        f"(at worst {in_percent(own.worst)}); total: {in_percent(total)}"
    ]
    if found.rms > TARGET:
        notes.append(f"error {found.rms:.2%} of full scale: more values, or more points, make it less")
    circuit = circuit_of_study(study)
    if circuit is not None:
        assert found.unseen is not None
        rms, worst = _missed_volts(circuit, found.unseen)
        readings = np.sqrt(np.square(study.voltage_error).mean([dim for dim in study.power.dims if dim != "taxel"]))
        in_all = float(np.hypot(rms, readings.max()))
        notes.append(
            f"voltage: error {rms:.2g} V (at worst {worst:.2g} V), on the same; with that of the study's readings "
            f"{in_all:.2g} V; one count: {circuit.step:.4g} V"
        )
        notes += filter(None, [saturated_words(circuit, study.power.values)])
        about["voltage"] = "voltage in V as the converter reads it, without noise; counts of the converter"
        volts = {"rms": rms, "worst": worst, "total": known(in_all), "of": "V", "tested": found.tested}
        about["voltage_error"] = json.dumps(volts)
        about["circuit"] = study.attrs["circuit"]
    notes.append(LEFT_OUT["model"])
    about[PRINTED] = as_json(printed_model(found, notes))
    content = _model(found, about, volts=None if circuit is None else _volts(circuit, float(study.power.max())))
    with replacing(Path(file)) as temporary:
        temporary.write_bytes(content)
    return found, notes


class StudyError(NamedTuple):
    """Total error of a study's readings, relative to the full scale of their taxel: root mean square of the worst
    taxel, and largest of all; NaN where an error is unknown."""

    rms: float
    worst: float


def study_error(study: xr.Dataset) -> StudyError:
    """The error of a study's own readings, which a model of them has beside that of its fit.

    Parameters
    ----------
    study : xr.Dataset
        Of one scene.

    Returns
    -------
    StudyError
        Relative to full scale; NaN if an error is unknown.
    """
    dims = [dim for dim in study.power.dims if dim != "taxel"]
    scale = study.power.max(dims) - study.power.min(dims)
    error = (study.total_error / scale.where(scale > 0)).where(study.power.notnull())
    unknown = bool((study.total_error.isnull() & study.power.notnull()).any())
    rms, worst = np.sqrt((error**2).mean(dims)).max(), error.max()
    return StudyError(*(float("nan") if unknown else float(each) for each in (rms, worst)))


def known(number: float) -> float | None:
    """A number as JSON has it."""
    return number if np.isfinite(number) else None


def _missed_volts(circuit: Circuit, unseen: Unseen) -> tuple[float, float]:
    """Error in V of readings unseen by the fit: root mean square of the worst taxel, and largest of all."""
    wanted, predicted = (respond(circuit, lit(power)).voltage for power in unseen)
    missed = predicted - wanted
    return float(np.sqrt(np.square(missed).mean(axis=0)).max()), float(np.abs(missed).max())


def write_calibration(found: Calibration, file: str | Path) -> None:
    """Write a calibration as an ONNX model.

    Its input ``inputs`` (rows, taxels) are readings in the calibration's unit; outputs are ``force`` (rows, forces) and
    ``half_width`` (forces,) of the intervals in N, and ``inside`` (rows,), whether the readings lie within the ranges
    of the fit.

    Parameters
    ----------
    found : Calibration
        As :func:`calibrate` returns it.
    file : str or Path
        Which is replaced if it exists.

    Raises
    ------
    InputError
        if onnx is not installed.
    """
    check_onnx()
    model = found.polynomial
    about = {
        "inputs": json.dumps(list(model.names)),
        "units": json.dumps(list(model.units)),
        "low": json.dumps(model.low.tolist()),
        "high": json.dumps(model.high.tolist()),
        "forces": json.dumps(list(found.forces)),
        "half_width": json.dumps(found.half_width.tolist()),
        "coverage": json.dumps({"wanted": found.coverage, "found": found.covered, "tested": found.tested}),
        "errors_leave_out": LEFT_OUT["calibration"],
        PRINTED: as_json(printed_calibration(found)),
    }
    content = _model(model, about, "force", found.half_width)
    with replacing(Path(file)) as temporary:
        temporary.write_bytes(content)


def read_printed(file: Path) -> Printed | None:
    """What was printed of a model or a calibration in a file; None if it is neither.

    Raises
    ------
    InputError
        if onnx is not installed.
    """
    check_onnx()
    import onnx
    from google.protobuf.message import DecodeError

    try:
        about = {entry.key: entry.value for entry in onnx.load(file, load_external_data=False).metadata_props}
        return from_json(about[PRINTED])
    except (OSError, DecodeError, KeyError, ValueError, TypeError):
        return None


def read_polynomial(file: Path) -> Polynomial | None:
    """The polynomial of the readings in a model that :func:`export` wrote; None if the file holds none.

    Only constants are read. The graph of the file is not run, as it may be somebody else's.

    Raises
    ------
    InputError
        if onnx is not installed.
    """
    check_onnx()
    import onnx
    from google.protobuf.message import DecodeError
    from onnx import TensorProto, numpy_helper

    try:
        model = onnx.load(file, load_external_data=False)
        about = {entry.key: entry.value for entry in model.metadata_props}
        held = {
            tensor.name: numpy_helper.to_array(tensor)
            for tensor in model.graph.initializer
            if tensor.data_location != TensorProto.EXTERNAL
        }
        low, high, weights, exponents = (
            np.asarray(held[name], dtype=float) for name in ("low", "high", "weights", "exponents")
        )
        names, units = (json.loads(about[key]) for key in ("inputs", "units"))
        shapes = low.shape, high.shape, exponents.shape, weights.shape
        count, terms = len(names), len(weights)
        finite = all(np.isfinite(array).all() for array in (low, high, weights))
        allowed = finite and np.isin(exponents, np.arange(MOST_DEGREE + 1)).all() and bool((low < high).any())
        words = all(re.fullmatch(r"[\w.]+", name) for name in names) and all("$" not in unit for unit in units)
        fits = shapes[:3] == ((count,), (count,), (1, terms, count)) and weights.ndim == 2 and len(units) == count
        if not (allowed and words and fits and weights.size):
            return None
    except (OSError, DecodeError, KeyError, ValueError, TypeError):
        return None
    if "readings" not in [output.name for output in model.graph.output]:
        return None  # a calibration
    return Polynomial(tuple(names), tuple(units), low, high, exponents[0], weights, math.nan, math.nan, "")


def check_onnx() -> None:
    """Raise `InputError` if onnx is not installed."""
    if find_spec("onnx") is None:
        raise InputError("models need onnx: install mitsuba_taxel[export].")


class _Part(NamedTuple):
    """Part of a graph: constants by name, steps as (operation, inputs, output, attributes), and names of its outputs
    (rows, taxels) in double precision."""

    constants: dict[str, np.ndarray]
    steps: list[_Step]
    outputs: list[str]


def _volts(circuit: Circuit, largest: float) -> _Part:
    """``voltage`` and ``counts`` of ``readings`` up to about a power in W: a sum of what lies beyond each corner."""
    power, voltage = straight_pieces(circuit, BEYOND * largest)
    slope = np.diff(voltage) / np.diff(power)
    constants = {
        "corners": power[:-1],
        "bends": np.diff(slope, prepend=0.0),
        "dark": voltage[0],
        "none": np.zeros(()),
        "step": np.array(circuit.step),
        "most": np.array(2.0**circuit.adc_bits - 1),
    }
    steps: list[_Step] = [
        ("Unsqueeze", ["readings", "last"], "light", {}),
        ("Sub", ["light", "corners"], "from_corners", {}),
        ("Max", ["from_corners", "none"], "beyond", {}),
        ("MatMul", ["beyond", "bends"], "above_dark", {}),
        ("Add", ["above_dark", "dark"], "voltage", {}),
        ("Div", ["voltage", "step"], "in_steps", {}),
        ("Floor", ["in_steps"], "whole", {}),
        ("Min", ["whole", "most"], "counts", {}),
    ]
    return _Part(constants, steps, ["voltage", "counts"])


def _model(
    polynomial: Polynomial,
    about: Mapping[str, str],
    output: str = "readings",
    width: np.ndarray | None = None,
    volts: _Part | None = None,
) -> bytes:
    from onnx import TensorProto, checker, helper, numpy_helper

    def constant(name: str, value: Any, kind: Any = float) -> Any:
        return numpy_helper.from_array(np.array(value, dtype=kind), name)

    span = polynomial.high - polynomial.low
    span = np.where(span > 0, span, 1.0)
    constants = [
        constant("low", polynomial.low),
        constant("high", polynomial.high),
        constant("rounding", ROUNDING * span),
        constant("factor", 2 / span),
        constant("shift", -1 - 2 * polynomial.low / span),
        constant("exponents", polynomial.exponents[None]),
        constant("weights", polynomial.weights),
        constant("middle", [1], np.int64),
        constant("last", [2], np.int64),
    ]
    steps: list[_Step] = [
        ("Max", ["inputs", "low"], "raised", {}),
        ("Min", ["raised", "high"], "clipped", {}),
        ("Sub", ["inputs", "clipped"], "beyond_box", {}),
        ("Abs", ["beyond_box"], "off_box", {}),
        ("LessOrEqual", ["off_box", "rounding"], "within", {}),
        ("Cast", ["within"], "ones", {"to": TensorProto.INT32}),
        ("ReduceMin", ["ones", "middle"], "all", {"keepdims": 0}),
        ("Cast", ["all"], "inside", {"to": TensorProto.BOOL}),
        ("Mul", ["clipped", "factor"], "stretched", {}),
        ("Add", ["stretched", "shift"], "scaled", {}),
        ("Unsqueeze", ["scaled", "middle"], "column", {}),
        ("Pow", ["column", "exponents"], "powers", {}),
        ("ReduceProd", ["powers", "last"], "terms", {"keepdims": 0}),
        ("MatMul", ["terms", "weights"], output, {}),
    ]
    results = [
        helper.make_tensor_value_info(output, TensorProto.DOUBLE, ["rows", polynomial.weights.shape[1]]),
        helper.make_tensor_value_info("inside", TensorProto.BOOL, ["rows"]),
    ]
    if width is not None:
        constants.append(constant("width", width))
        steps.append(("Identity", ["width"], "half_width", {}))
        results.append(helper.make_tensor_value_info("half_width", TensorProto.DOUBLE, [len(width)]))
    if volts is not None:
        constants += [constant(name, value) for name, value in volts.constants.items()]
        steps += volts.steps
        shape = ["rows", polynomial.weights.shape[1]]
        results += [helper.make_tensor_value_info(name, TensorProto.DOUBLE, shape) for name in volts.outputs]
    count = len(polynomial.names)
    graph = helper.make_graph(
        [helper.make_node(kind, inputs, [output], **how) for kind, inputs, output, how in steps],
        output,
        [helper.make_tensor_value_info("inputs", TensorProto.DOUBLE, ["rows", count])],
        results,
        constants,
    )
    opsets = [helper.make_opsetid("", OPSET)]
    model = helper.make_model(graph, producer_name="mitsuba_taxel", opset_imports=opsets, ir_version=IR)
    helper.set_model_props(model, dict(about))
    checker.check_model(model)
    return model.SerializeToString()
