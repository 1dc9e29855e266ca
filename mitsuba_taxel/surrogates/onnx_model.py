"""A polynomial as an ONNX graph of a few operations, with its box, units and error as metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.atomic import replacing
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.surrogates.calibration import Calibration
from mitsuba_taxel.surrogates.polynomial import Polynomial, polynomial_of

OPSET, IR = 18, 8
"""Versions of ONNX supported by runtimes since 2023."""
TARGET = 0.01
"""Relative to full scale: a larger error gives a note."""


def export(study: xr.Dataset | xr.DataTree, file: str | Path) -> tuple[Polynomial, list[str]]:
    """Write a model of a study's readings that needs nothing but an ONNX runtime.

    Its input ``inputs`` (rows, inputs) has the varied parameters; its outputs are ``readings`` (rows, taxels) in W and
    ``inside`` (rows,), whether the inputs lie in the box covered by the study. Beyond it the readings are those at its
    edge. The metadata contain names, units and ranges of the inputs, the test error, scene, parameters and versions.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        As returned by ``open_study``, of one scene.
    file : str or Path
        Must end in ``.onnx``.

    Returns
    -------
    The polynomial of the model, and notes.

    Raises
    ------
    InputError
        if onnx is not installed, or the study has several scenes, varied words or too few values.
    """
    check_onnx()
    if isinstance(study, xr.DataTree):
        raise InputError("the study holds several scenes: the folder of one of them is needed.")
    found = polynomial_of(study)
    about = {
        "inputs": json.dumps(list(found.names)),
        "units": json.dumps(list(found.units)),
        "low": json.dumps(found.low.tolist()),
        "high": json.dumps(found.high.tolist()),
        "readings": "optical power in W per taxel, row by row from (-x, +y)",
        "error": json.dumps({"rms": found.rms, "worst": found.worst, "of": "full scale", "tested": found.tested}),
        **{name: str(study.attrs[name]) for name in ("scene", "parameters", "seed", "points", "versions")},
    }
    content = _model(found, about)
    with replacing(Path(file)) as temporary:
        temporary.write_bytes(content)
    notes = [f"error {found.rms:.2%} of full scale: more values, or more points, make it less"]
    return found, notes if found.rms > TARGET else []


def write_calibration(found: Calibration, file: str | Path) -> None:
    """Write a calibration as a model: ``inputs`` (rows, taxels) are readings in its unit; outputs are ``force`` (rows,
    forces) and ``half_width`` (forces,) of the intervals in N, and ``inside`` (rows,), whether the readings lie within
    the ranges of the fit.

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
    }
    content = _model(model, about, "force", found.half_width)
    with replacing(Path(file)) as temporary:
        temporary.write_bytes(content)


def check_onnx() -> None:
    """Raise `InputError` if onnx is not installed."""
    if find_spec("onnx") is None:
        raise InputError("models need onnx: install mitsuba_taxel[export].")


def _model(
    polynomial: Polynomial, about: Mapping[str, str], output: str = "readings", width: np.ndarray | None = None
) -> bytes:
    from onnx import TensorProto, checker, helper, numpy_helper

    def constant(name: str, value: Any, kind: Any = float) -> Any:
        return numpy_helper.from_array(np.array(value, dtype=kind), name)

    span = polynomial.high - polynomial.low
    span = np.where(span > 0, span, 1.0)
    constants = [
        constant("low", polynomial.low),
        constant("high", polynomial.high),
        constant("factor", 2 / span),
        constant("shift", -1 - 2 * polynomial.low / span),
        constant("exponents", polynomial.exponents[None]),
        constant("weights", polynomial.weights),
        constant("middle", [1], np.int64),
        constant("last", [2], np.int64),
    ]
    steps: list[tuple[str, list[str], str, dict[str, Any]]] = [
        ("Max", ["inputs", "low"], "raised", {}),
        ("Min", ["raised", "high"], "clipped", {}),
        ("Equal", ["clipped", "inputs"], "within", {}),
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
