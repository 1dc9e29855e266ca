"""Export of a polynomial as an ONNX graph of a few operations, with its ranges, units and errors as metadata."""

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

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.base.files.printed import Printed, as_json, from_json
from mitsuba_taxel.base.left_out import LEFT_OUT
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
"""Error relative to full scale above which a note is given."""
ROUNDING = 1e-9
"""Distance relative to the box at which inputs still count as inside, such as 1e-12 N on an unloaded pad."""
PRINTED = "printed"
"""Key of the metadata with what the command prints."""
BEYOND = 2.0
"""Power up to which the circuit's response is tabulated, relative to the largest of the study; beyond, the last
straight piece continues."""


def export(study: xr.Dataset | xr.DataTree, file: str | Path) -> tuple[Polynomial, list[str]]:
    """Fit a polynomial to the readings of a study, and write it as an ONNX model.

    Its input ``inputs`` (rows, inputs) has the varied parameters. Its outputs are ``readings`` (rows, taxels) in W and
    ``inside`` (rows,), which is true if all inputs are within the ranges of the study. Outside these ranges, the
    readings are those at the edge. For a study with a circuit, ``voltage`` in V and ``counts``, both (rows, taxels),
    are further outputs: the piecewise linear response of the circuit to these readings. The metadata contain names,
    units and ranges of the inputs; the test error, the error of the study, and the total of both; scene, parameters and
    versions.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        Result of ``open_study`` for a study of one scene.
    file : str or Path
        Output file, whose name must end in ``.onnx``.

    Returns
    -------
    model : Polynomial
        Contents of the file.
    notes : list[str]
        Errors of the model, and the sources of error that they do not contain.

    Raises
    ------
    InputError
        if onnx is not installed, or the study has several scenes, varied words or too few values.
    """
    # The polynomial, and metadata of its inputs and of its error on unseen readings.
    check_onnx()
    study = single(study)
    model = polynomial_of(study)
    metadata = {
        "inputs": json.dumps(list(model.names)),
        "units": json.dumps(list(model.units)),
        "low": json.dumps(model.low.tolist()),
        "high": json.dumps(model.high.tolist()),
        "readings": "optical power in W per taxel, row by row from (-x, +y)",
        "error": json.dumps({"rms": model.rms, "worst": model.worst, "of": "full scale", "tested": model.tested}),
        "errors_leave_out": LEFT_OUT["model"],
        **{name: str(study.attrs[name]) for name in ("scene", "parameters", "seed", "points", "versions")},
    }
    # Error of the study itself, and total error.
    own_error = study_error(study)
    metadata["study_error"] = json.dumps(
        {"rms": json_number(own_error.rms), "worst": json_number(own_error.worst), "of": "full scale"}
    )
    total = float(np.hypot(model.rms, own_error.rms))
    metadata["total_error"] = json.dumps({"rms": json_number(total), "of": "full scale"})
    notes = [
        f"error of the study's own readings (light, finite elements, surfaces): {in_percent(own_error.rms)} of full "
        f"scale (at worst {in_percent(own_error.worst)}); total: {in_percent(total)}"
    ]
    if model.rms > TARGET:
        notes.append(
            f"error {model.rms:.2%} of full scale: more values of the varied parameters, or more points, reduce it"
        )
    # With a circuit: error in V, from the same test readings.
    circuit = circuit_of_study(study)
    if circuit is not None:
        assert model.unseen is not None
        rms, worst = _voltage_error(circuit, model.unseen)
        readings = np.sqrt(np.square(study.voltage_error).mean([dim for dim in study.power.dims if dim != "taxel"]))
        total_voltage_error = float(np.hypot(rms, readings.max()))
        notes.append(
            f"voltage: error {rms:.2g} V (at worst {worst:.2g} V) in the same test; {total_voltage_error:.2g} V with "
            f"the error of the study's readings; one count is {circuit.step:.4g} V"
        )
        notes += filter(None, [saturated_words(circuit, study.power.values)])
        metadata["voltage"] = "voltage in V as the converter reads it, without noise; counts of the converter"
        volts = {
            "rms": rms,
            "worst": worst,
            "total": json_number(total_voltage_error),
            "of": "V",
            "tested": model.tested,
        }
        metadata["voltage_error"] = json.dumps(volts)
        metadata["circuit"] = study.attrs["circuit"]
    # Write the graph with its metadata.
    notes.append(LEFT_OUT["model"])
    metadata[PRINTED] = as_json(printed_model(model, notes))
    content = _model(model, metadata, volts=None if circuit is None else _volts(circuit, float(study.power.max())))
    with replacing(Path(file)) as temporary:
        temporary.write_bytes(content)
    return model, notes


class StudyError(NamedTuple):
    """Total error of the readings of a study, relative to the full scale of their taxel; NaN if an error is unknown.

    Attributes
    ----------
    rms : float
        Root mean square over the readings of the worst taxel.
    worst : float
        Largest error of all readings.
    """

    rms: float
    worst: float


def study_error(study: xr.Dataset) -> StudyError:
    """Total error of the readings of a study; a model of the study has this error in addition to that of its fit.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.

    Returns
    -------
    StudyError
        Errors relative to full scale; NaN if an error is unknown.
    """
    dims = [dim for dim in study.power.dims if dim != "taxel"]
    scale = study.power.max(dims) - study.power.min(dims)
    error = (study.total_error / scale.where(scale > 0)).where(study.power.notnull())
    unknown = bool((study.total_error.isnull() & study.power.notnull()).any())
    rms, worst = np.sqrt((error**2).mean(dims)).max(), error.max()
    return StudyError(*(float("nan") if unknown else float(number) for number in (rms, worst)))


def json_number(number: float) -> float | None:
    """Convert a number for JSON, which has no NaN: None if it is not finite."""
    return number if np.isfinite(number) else None


def _voltage_error(circuit: Circuit, unseen: Unseen) -> tuple[float, float]:
    """Error in V of the predictions of readings that were left out of the fit: the root mean square for the worst
    taxel, and the largest error.
    """
    expected, predicted = (respond(circuit, lit(power)).voltage for power in unseen)
    residual = predicted - expected
    return float(np.sqrt(np.square(residual).mean(axis=0)).max()), float(np.abs(residual).max())


def write_calibration(found: Calibration, file: str | Path) -> None:
    """Write a calibration as an ONNX model.

    Its input ``inputs`` (rows, taxels) are readings in the calibration's unit; outputs are ``force`` (rows, forces) in
    N, ``half_width`` (forces,) of the intervals in N, and ``inside`` (rows,), whether the readings lie within the
    ranges of the fit. If a depth or a place is among the quantities, the first output is called ``quantity``; names and
    units of its columns are in the metadata ``quantities``.

    Parameters
    ----------
    found : Calibration
        Result of :func:`calibrate`.
    file : str or Path
        Output file, which is replaced if it exists.

    Raises
    ------
    InputError
        if onnx is not installed.
    """
    check_onnx()
    polynomial = found.polynomial
    metadata = {
        "inputs": json.dumps(list(polynomial.names)),
        "units": json.dumps(list(polynomial.units)),
        "low": json.dumps(polynomial.low.tolist()),
        "high": json.dumps(polynomial.high.tolist()),
        "forces": json.dumps(list(found.forces)),
        "half_width": json.dumps(found.half_width.tolist()),
        "quantities": json.dumps(dict(zip(found.forces, found.units, strict=True))),
        "coverage": json.dumps(
            {
                "wanted": found.coverage,
                "found": found.covered,
                "found_error": json_number(found.covered_error),
                "tested": found.tested,
                "paths": found.paths,
                "paths_needed": found.needed,
            }
        ),
        "errors_leave_out": LEFT_OUT["calibration"],
        PRINTED: as_json(printed_calibration(found)),
    }
    output = "force" if set(found.units) == {"N"} else "quantity"
    content = _model(polynomial, metadata, output, found.half_width)
    with replacing(Path(file)) as temporary:
        temporary.write_bytes(content)


def read_printed(file: Path) -> Printed | None:
    """Read the printed summary of a model or a calibration from its ONNX file; None if the file has no summary.

    Raises
    ------
    InputError
        if onnx is not installed.
    """
    check_onnx()
    import onnx
    from google.protobuf.message import DecodeError

    try:
        metadata = {entry.key: entry.value for entry in onnx.load(file, load_external_data=False).metadata_props}
        return from_json(metadata[PRINTED])
    except (OSError, DecodeError, KeyError, ValueError, TypeError):
        return None


def read_polynomial(file: Path) -> Polynomial | None:
    """Read the polynomial from an ONNX file that :func:`export` wrote; None for any other file.

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
        # Read constants that are in the file itself.
        model = onnx.load(file, load_external_data=False)
        metadata = {entry.key: entry.value for entry in model.metadata_props}
        constants = {
            tensor.name: numpy_helper.to_array(tensor)
            for tensor in model.graph.initializer
            if tensor.data_location != TensorProto.EXTERNAL
        }
        low, high, weights, exponents = (
            np.asarray(constants[name], dtype=float) for name in ("low", "high", "weights", "exponents")
        )
        names, units = (json.loads(metadata[key]) for key in ("inputs", "units"))
        # Shapes, ranges and names must be those of a polynomial.
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
    return Polynomial(
        names=tuple(names),
        units=tuple(units),
        low=low,
        high=high,
        exponents=exponents[0],
        weights=weights,
        rms=math.nan,
        worst=math.nan,
        tested="",
    )


def check_onnx() -> None:
    """Raise `InputError` if onnx is not installed."""
    if find_spec("onnx") is None:
        raise InputError("models need onnx: pip install onnx.")


class _Subgraph(NamedTuple):
    """Additional nodes of an ONNX graph: constants by name, steps as (operation, inputs, output, attributes), and names
    of the outputs (rows, taxels) in double precision."""

    constants: dict[str, np.ndarray]
    steps: list[_Step]
    outputs: list[str]


def _volts(circuit: Circuit, largest: float) -> _Subgraph:
    """Nodes that compute ``voltage`` and ``counts`` from ``readings``, for powers up to about ``largest`` in W.

    The response is piecewise linear: a sum of ramps that begin at the corners, weighted by the changes of slope.
    """
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
    return _Subgraph(constants, steps, ["voltage", "counts"])


def _model(
    polynomial: Polynomial,
    metadata: Mapping[str, str],
    output: str = "readings",
    width: np.ndarray | None = None,
    volts: _Subgraph | None = None,
) -> bytes:
    """A serialised ONNX model of a polynomial.

    Parameters
    ----------
    polynomial : Polynomial
        The model.
    metadata : Mapping[str, str]
        Entries of the file.
    output : str
        Name of the polynomial's values (rows, taxels).
    width : (taxels,) ndarray, optional
        Constant output ``half_width``.
    volts : _Subgraph, optional
        Nodes from readings to voltages and counts.
    """
    from onnx import TensorProto, checker, helper, numpy_helper

    def constant(name: str, value: Any, kind: Any = float) -> Any:
        return numpy_helper.from_array(np.array(value, dtype=kind), name)

    # The polynomial: clip the inputs to the box, scale them to -1 ... 1, and sum the products of their powers.
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
    # Further outputs: half widths, voltages and counts.
    if width is not None:
        constants.append(constant("width", width))
        steps.append(("Identity", ["width"], "half_width", {}))
        results.append(helper.make_tensor_value_info("half_width", TensorProto.DOUBLE, [len(width)]))
    if volts is not None:
        constants += [constant(name, value) for name, value in volts.constants.items()]
        steps += volts.steps
        shape = ["rows", polynomial.weights.shape[1]]
        results += [helper.make_tensor_value_info(name, TensorProto.DOUBLE, shape) for name in volts.outputs]
    # Assemble, check and serialise the model.
    count = len(polynomial.names)
    graph = helper.make_graph(
        [helper.make_node(kind, inputs, [output], **attributes) for kind, inputs, output, attributes in steps],
        output,
        [helper.make_tensor_value_info("inputs", TensorProto.DOUBLE, ["rows", count])],
        results,
        constants,
    )
    opsets = [helper.make_opsetid("", OPSET)]
    model = helper.make_model(graph, producer_name="mitsuba_taxel", opset_imports=opsets, ir_version=IR)
    helper.set_model_props(model, dict(metadata))
    checker.check_model(model)
    return model.SerializeToString()
