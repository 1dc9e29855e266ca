"""A contact model as an ONNX graph: the iteration of `contact_iteration`, followed by readings and flags."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mitsuba_taxel.surrogates.contact_iteration import RELAXATION, TOLERANCE, Iteration, iteration_of
from mitsuba_taxel.surrogates.contact_readings import (
    BEYOND,
    FEW_PATCHES,
    LIGHT,
    NOT_A_NUMBER,
    NOT_RESOLVED,
    NOT_SOLVED,
    TOO_DEEP,
    TOO_FAR,
    UNLIKE,
    ContactModel,
    SecondOrder,
)
from mitsuba_taxel.surrogates.onnx_model import IR, OPSET, check_onnx

UNSOLVED = 1e-6
"""Residual of the forces, relative to the largest, above which contact counts as not solved."""
_Step = tuple[str, str, str]
"""Operation with its attributes, inputs, and outputs, as words."""
_MEANS: list[_Step] = [
    # Second differences along {axis}, where both neighbours lie below the body.
    ("Slice", "clean zero_{axis} but_two_{axis} axis_{axis}", "before_{axis}"),
    ("Slice", "clean one but_one_{axis} axis_{axis}", "own_{axis}"),
    ("Slice", "clean two end_{axis} axis_{axis}", "after_{axis}"),
    ("Add", "before_{axis} after_{axis}", "neighbours_{axis}"),
    ("Mul", "own_{axis} double", "twice_{axis}"),
    ("Sub", "neighbours_{axis} twice_{axis}", "difference_{axis}"),
    ("Div", "difference_{axis} divisor", "correction_{axis}"),
    ("Min", "before_{axis} own_{axis} after_{axis}", "lowest_{axis}"),
    ("Greater", "lowest_{axis} none", "below_{axis}"),
    ("Where", "below_{axis} correction_{axis} none", "inner_{axis}"),
    ("Pad", "inner_{axis} margin_{axis}", "padded_{axis}"),
]
_SLOPES: list[_Step] = [
    # Slopes along {axis}: means of those to both neighbours below the body; at an edge, extrapolated from the next.
    ("Slice", "clean zero_{axis} but_one_{axis} axis_{axis}", "lower_{axis}"),
    ("Slice", "clean one end_{axis} axis_{axis}", "upper_{axis}"),
    ("Sub", "upper_{axis} lower_{axis}", "rise_{axis}"),
    ("Div", "rise_{axis} step_{axis}", "plain_slope_{axis}"),
    ("Min", "lower_{axis} upper_{axis}", "lower_depth_{axis}"),
    ("Greater", "lower_depth_{axis} none", "both_{axis}"),
    ("Where", "both_{axis} plain_slope_{axis} none", "slope_{axis}"),
    ("Cast to=double", "both_{axis}", "both_number_{axis}"),
    ("Pad", "slope_{axis} wide_margin_{axis}", "slopes_{axis}"),
    ("Pad", "both_number_{axis} wide_margin_{axis}", "knowns_{axis}"),
    ("Slice", "slopes_{axis} zero_{axis} end_{axis} axis_{axis}", "slope_2_before_{axis}"),
    ("Slice", "slopes_{axis} one past_one_{axis} axis_{axis}", "slope_before_{axis}"),
    ("Slice", "slopes_{axis} two past_two_{axis} axis_{axis}", "slope_after_{axis}"),
    ("Slice", "slopes_{axis} three past_three_{axis} axis_{axis}", "slope_2_after_{axis}"),
    ("Slice", "knowns_{axis} zero_{axis} end_{axis} axis_{axis}", "known_2_before_{axis}"),
    ("Slice", "knowns_{axis} one past_one_{axis} axis_{axis}", "known_before_{axis}"),
    ("Slice", "knowns_{axis} two past_two_{axis} axis_{axis}", "known_after_{axis}"),
    ("Slice", "knowns_{axis} three past_three_{axis} axis_{axis}", "known_2_after_{axis}"),
    *(
        step
        for name in ("before", "after")
        for step in (
            ("Sub", f"slope_{name}_{{axis}} slope_2_{name}_{{axis}}", f"bend_{name}_{{axis}}"),
            ("Mul", f"bend_{name}_{{axis}} known_2_{name}_{{axis}}", f"known_bend_{name}_{{axis}}"),
            ("Mul", f"known_bend_{name}_{{axis}} half", f"half_bend_{name}_{{axis}}"),
            ("Add", f"slope_{name}_{{axis}} half_bend_{name}_{{axis}}", f"edge_slope_{name}_{{axis}}"),
            ("Greater", f"known_{name}_{{axis}} none", f"is_{name}_{{axis}}"),
            ("Where", f"is_{name}_{{axis}} edge_slope_{name}_{{axis}} none", f"only_{name}_{{axis}}"),
        )
    ),
    ("Add", "slope_before_{axis} slope_after_{axis}", "slope_sum_{axis}"),
    ("Mul", "slope_sum_{axis} half", "slope_mean_{axis}"),
    ("And", "is_before_{axis} is_after_{axis}", "is_inner_{axis}"),
    ("Add", "only_before_{axis} only_after_{axis}", "outer_slope_{axis}"),
    ("Where", "is_inner_{axis} slope_mean_{axis} outer_slope_{axis}", "whole_slope_{axis}"),
    ("Reshape", "whole_slope_{axis} flat", "slope_row_{axis}"),
    ("Gather axis=1", "slope_row_{axis} covered", "slope_on_top_{axis}"),
    ("Mul", "changed_forces slope_on_top_{axis}", "pushed_{axis}"),
    ("Mul", "pushed_{axis} side_ratio", "tangential_{axis}"),
    ("ReduceSum keepdims=1", "tangential_{axis} last", "tangential_sum_{axis}"),
    ("Mul", "tangential_{axis} heights", "turning_{axis}"),
    ("ReduceSum keepdims=1", "turning_{axis} last", "lever_{axis}"),
]
_FORCES: list[_Step] = [
    ("IsInf", "depth", "infinite"),
    ("IsNaN", "depth", "unknown"),
    ("Or", "infinite unknown", "bad"),
    ("Where", "bad none depth", "clean"),
    ("Cast to=int64", "bad", "bad_number"),
    ("ReduceMax keepdims=0", "bad_number map_axes", "bad_pad"),
    ("ReduceMax keepdims=0", "clean map_axes", "deepest"),
]
_CONTACT: list[_Step] = [
    ("Reshape", "means flat", "row"),
    ("Gather axis=1", "row covered", "on_top"),
    ("Greater", "on_top none", "within"),
    ("Max", "on_top none", "right"),
    ("Mul", "right none", "start"),
]
_BODY: list[_Step] = [
    ("Sub", "forces_in dual_in", "difference"),
    ("Mul", "difference penalty", "proximal"),
    ("Add", "right proximal", "side"),
    ("MatMul", "side operator", "free"),
    ("Mul", "free relaxed", "part"),
    ("Mul", "forces_in unrelaxed", "rest_part"),
    ("Add", "part rest_part", "mixed"),
    ("Add", "mixed dual_in", "total_force"),
    ("Max", "total_force none", "positive"),
    ("Where", "within positive none", "forces_out"),
    ("Sub", "total_force forces_out", "dual_out"),
    ("Sub", "free forces_out", "miss"),
    ("Sub", "forces_out forces_in", "step"),
    ("Abs", "miss", "miss_size"),
    ("Abs", "step", "step_size"),
    ("Max", "miss_size step_size", "sizes"),
    ("ReduceMax keepdims=0", "sizes last", "residual_out"),
    ("ReduceMax keepdims=0", "forces_out last", "largest_out"),
    ("Mul", "largest_out tolerance", "allowed"),
    ("Greater", "residual_out allowed", "open"),
    ("Cast to=int64", "open", "open_number"),
    ("ReduceMax keepdims=0", "open_number first", "any_open"),
    ("Cast to=bool", "any_open", "go_on_out"),
]
_READINGS: list[_Step] = [
    ("ReduceMax keepdims=0", "forces last", "largest"),
    ("Mul", "largest unsolved", "limit"),
    ("Greater", "residual limit", "open_pad"),
    ("Cast to=int64", "open_pad", "open_pad_number"),
    ("Greater", "forces none", "touching"),
    ("Cast to=double", "touching", "touching_number"),
    ("ReduceSum keepdims=0", "touching_number last", "patches"),
    ("Mul", "patches patch_area", "plain_area"),
    # Second-order terms of the forces.
    ("Max", "deepest none", "deep_length"),
    ("Div", "deep_length height", "deep"),
    ("Sqrt", "plain_area", "root_area"),
    ("Div", "root_area height", "wide"),
    ("Unsqueeze", "deep last", "deep_column"),
    ("Unsqueeze", "wide last", "wide_column"),
    ("ReduceSum keepdims=1", "forces last", "plain_total"),
    ("MatMul", "forces squares", "plain_squares"),
    ("Max", "plain_total tiny", "divisor_total"),
    ("Div", "plain_squares divisor_total", "apart_column"),
    ("Mul", "deep_column apart_column", "deep_apart"),
    ("Concat axis=1", "deep_column wide_column deep_apart", "force_features"),
    ("MatMul", "force_features force_terms", "force_term"),
    ("Add", "force_unit force_term", "ratio"),
    ("Mul", "forces ratio", "changed_forces"),
    # Sum, moments, and second-order terms of the readings.
    ("ReduceSum keepdims=1", "changed_forces last", "total"),
    ("MatMul", "changed_forces points", "about"),
    ("Greater", "total none", "pressed"),
    ("Where", "pressed total not_known", "pressed_total"),
    ("Div", "about pressed_total", "plain_centre"),
    ("MatMul", "changed_forces gradient", "linear"),
    ("Mul", "total softness", "strain"),
    ("Div", "linear rest", "relative"),
    ("Mul", "relative by_change", "first_term"),
    ("Mul", "deep_column by_depth", "second_term"),
    ("Mul", "strain by_force", "third_term"),
    ("Sum", "reading_unit first_term second_term third_term", "factor"),
    ("Mul", "linear factor", "change"),
    ("Add", "rest change", "plain_power"),
    ("MatMul", "changed_forces onto_map", "flat_pressure"),
    ("Reshape", "flat_pressure map_shape", "plain_pressure"),
    ("Reshape", "clean flat", "depth_row"),
    ("Gather axis=1", "depth_row covered", "depth_on_top"),
    ("Max", "depth_on_top none", "lowered"),
    ("Sub", "height lowered", "heights"),
]
_WRENCH: list[_Step] = [
    ("MatMul", "total down", "normal"),
    ("Mul", "tangential_sum_2 along_x", "force_x"),
    ("Mul", "tangential_sum_1 along_y", "force_y"),
    ("Sum", "normal force_x force_y", "plain_force"),
    ("MatMul", "about crossed", "upright"),
    ("Mul", "lever_2 along_y", "moment_y"),
    ("Mul", "lever_1 minus_along_x", "moment_x"),
    ("MatMul", "tangential_1 place_x", "turn_1"),
    ("MatMul", "tangential_2 place_y", "turn_2"),
    ("Sub", "turn_1 turn_2", "turn"),
    ("Mul", "turn along_z", "moment_z"),
    ("Sum", "upright moment_x moment_y moment_z", "plain_moment"),
]
_STATUS: list[_Step] = [
    # Status.
    ("Greater", "deepest largest_depth", "too_deep"),
    ("Less", "plain_centre low", "too_low"),
    ("Greater", "plain_centre high", "too_high"),
    ("Or", "too_low too_high", "far"),
    ("Cast to=int64", "far", "far_number"),
    ("ReduceMax keepdims=0", "far_number last", "too_far"),
    ("Less", "patches few_patches", "few"),
    ("Greater", "patches none", "some"),
    ("Greater", "deepest light_depth", "not_light"),
    ("And", "few some", "few_some"),
    ("And", "few_some not_light", "not_resolved"),
    ("Greater", "force_features most_features", "beyond"),
    ("LessOrEqual", "ratio none", "turned"),
    ("Concat axis=1", "beyond turned", "beyond_or_turned"),
    ("Cast to=int64", "beyond_or_turned", "unlike_numbers"),
    ("ReduceMax keepdims=0", "unlike_numbers last", "any_unlike"),
    ("Cast to=int64", "some", "some_number"),
    ("Mul", "any_unlike some_number", "unlike"),
    ("Cast to=int64", "too_deep", "too_deep_number"),
    ("Cast to=int64", "not_resolved", "not_resolved_number"),
    ("Sub", "one_pad bad_pad", "good_pad"),
    ("Mul", "good_pad open_pad_number", "not_solved_number"),
    ("Sub", "good_pad not_solved_number", "known_pad"),
    ("Mul", "too_deep_number good_pad", "known_too_deep"),
    ("Mul", "too_far known_pad", "known_too_far"),
    ("Mul", "not_resolved_number known_pad", "known_not_resolved"),
    ("Mul", "unlike known_pad", "known_unlike"),
    ("Mul", "bad_pad bit_not_a_number", "bits_1"),
    ("Mul", "known_too_deep bit_too_deep", "bits_2"),
    ("Mul", "known_too_far bit_too_far", "bits_3"),
    ("Mul", "known_not_resolved bit_not_resolved", "bits_4"),
    ("Mul", "not_solved_number bit_not_solved", "bits_5"),
    ("Mul", "known_unlike bit_unlike", "bits_6"),
    ("Add", "bits_1 bits_2", "sum_2"),
    ("Add", "sum_2 bits_3", "sum_3"),
    ("Add", "sum_3 bits_4", "sum_4"),
    ("Add", "sum_4 bits_5", "sum_5"),
    ("Add", "sum_5 bits_6", "status"),
    # Results that are not known are NaN.
    ("Add", "bad_pad not_solved_number", "unknown_number"),
    ("Cast to=bool", "unknown_number", "unknown_pad"),
    ("Unsqueeze", "unknown_pad last", "unknown_row"),
    ("Unsqueeze", "unknown_row last", "unknown_map"),
    ("Where", "unknown_row not_known plain_power", "power"),
    ("Where", "unknown_row not_known plain_force", "force"),
    ("Where", "unknown_row not_known plain_moment", "moment"),
    ("Where", "unknown_row not_known plain_centre", "centre"),
    ("Where", "unknown_pad not_known plain_area", "area"),
    ("Where", "unknown_map not_known plain_pressure", "pressure"),
]


def onnx_of_contact(model: ContactModel, metadata: Mapping[str, str]) -> bytes:
    """Convert a contact model to an ONNX model.

    The input ``depth`` (pads, rows, columns) in mm and the outputs are those of a `ContactModel`, in double precision;
    ``status`` is int64.

    Parameters
    ----------
    model : ContactModel
        The model.
    metadata : Mapping[str, str]
        Entries of the file; the difference from the model itself is added to them.

    Returns
    -------
    bytes
        The serialised model.

    Raises
    ------
    InputError
        if onnx is not installed.
    ComputationError
        if the iteration does not converge for this pad.
    """
    check_onnx()
    from onnx import TensorProto, checker, helper, numpy_helper

    iteration = iteration_of(model)
    rows, columns = model.covered.shape
    axes = [axis for axis in (1, 2) if model.covered.shape[axis - 1] > 2]
    corrections = [(kind, *(words.format(axis=axis) for words in names)) for axis in axes for kind, *names in _MEANS]
    means: _Step = ("Sum", " ".join(["clean", *(f"padded_{axis}" for axis in axes)]), "means")

    def node(kind: str, inputs: str, outputs: str, **attributes: Any) -> Any:
        name, *words = kind.split()
        for word in words:
            key, value = word.split("=")
            attributes[key] = int(value) if key != "to" else TensorProto.DataType.Value(value.upper())
        return helper.make_node(name, inputs.split(), outputs.split(), **attributes)

    def values(name: str, shape: list[Any], kind: int = TensorProto.DOUBLE) -> Any:
        return helper.make_tensor_value_info(name, kind, shape)

    # The loop over the iterations.
    patches = len(model.compliance)
    state = [values("forces", ["pads", patches]), values("dual", ["pads", patches]), values("residual", ["pads"])]
    own = [values(f"{value.name}_in", [d.dim_param or d.dim_value for d in value.type.tensor_type.shape.dim])
           for value in state]  # fmt: skip
    results = [values("go_on_out", [], TensorProto.BOOL)]
    results += [values(f"{value.name}_out", [d.dim_param or d.dim_value for d in value.type.tensor_type.shape.dim])
                for value in state]  # fmt: skip
    body = helper.make_graph(
        [node(*step) for step in _BODY],
        "iteration",
        [values("number", [], TensorProto.INT64), values("go_on_in", [], TensorProto.BOOL), *own],
        results,
    )
    loop = node("Loop", "count yes start start deepest", "forces dual residual", body=body)

    # The whole graph.
    nodes = [node(*step) for step in [*_FORCES, *corrections, means, *_CONTACT]]
    slopes = [(kind, *(words.format(axis=axis) for words in names)) for axis in (1, 2) for kind, *names in _SLOPES]
    nodes += [loop, *(node(*step) for step in [*_READINGS, *slopes, *_WRENCH, *_STATUS])]
    outputs = [
        *(values(name, ["pads", count]) for name, count in (("power", len(model.rest)), ("force", 3), ("moment", 3))),
        values("centre", ["pads", 2]),
        values("area", ["pads"]),
        values("pressure", ["pads", rows, columns]),
        values("status", ["pads"], TensorProto.INT64),
    ]
    constants = [
        numpy_helper.from_array(np.asarray(value), name) for name, value in _constants(model, iteration).items()
    ]
    graph = helper.make_graph(nodes, "contact", [values("depth", ["pads", rows, columns])], outputs, constants)
    whole = helper.make_model(
        graph, producer_name="mitsuba_taxel", opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR
    )
    difference = {"difference": f"forces within {iteration.difference:.1e} of the largest, of those of the .npz model"}
    helper.set_model_props(whole, {**metadata, **difference})
    checker.check_model(whole)
    return whole.SerializeToString()


def _constants(model: ContactModel, iteration: Iteration) -> dict[str, Any]:
    """Constants of the ONNX graph of a contact model, by name."""
    rows, columns = model.covered.shape
    area, patches, taxels = model.size[0] * model.size[1], len(model.compliance), len(model.rest)
    second = model.second or SecondOrder(np.zeros((taxels, 4)), np.zeros(4), np.full(4, np.inf))
    points = model.points[model.covered][:, :2]
    squares = ((points - [model.x.mean(), model.y.mean()]) ** 2).sum(axis=1) / model.height**2
    onto_map = np.zeros((patches, rows * columns))
    onto_map[np.arange(patches), np.flatnonzero(model.covered)] = 1 / area
    bits = {
        "not_a_number": NOT_A_NUMBER,
        "too_deep": TOO_DEEP,
        "too_far": TOO_FAR,
        "not_resolved": NOT_RESOLVED,
        "not_solved": NOT_SOLVED,
        "unlike": UNLIKE,
    }
    constants: dict[str, Any] = {
        "none": 0.0,
        "not_known": np.nan,
        "double": 2.0,
        "divisor": 24.0,
        "one_pad": 1,
        "first": [0],
        "last": [1],
        "one": [1],
        "two": [2],
        "map_axes": [1, 2],
        "flat": [-1, rows * columns],
        "map_shape": [-1, rows, columns],
        "covered": np.flatnonzero(model.covered),
        "yes": True,
        "count": iteration.most,
        "penalty": iteration.penalty,
        "operator": iteration.operator,
        "relaxed": RELAXATION,
        "unrelaxed": 1 - RELAXATION,
        "tolerance": TOLERANCE,
        "unsolved": UNSOLVED,
        "gradient": model.gradient.T.copy(),
        "rest": model.rest,
        "points": points.copy(),
        "squares": squares[:, None].copy(),
        "place_x": points[:, :1].copy(),
        "place_y": points[:, 1:].copy(),
        "half": 0.5,
        "three": [3],
        "tiny": np.finfo(float).tiny,
        "patch_area": area,
        "height": model.height,
        "softness": model.compliance.mean() / model.height,
        "reading_unit": 1 + second.reading[:, 0],
        "by_change": second.reading[:, 1].copy(),
        "by_depth": second.reading[:, 2].copy(),
        "by_force": second.reading[:, 3].copy(),
        "force_unit": 1 + second.force[0],
        "force_terms": second.force[1:, None].copy(),
        "most_features": BEYOND * second.largest[None, 1:],
        "side_ratio": -second.side,
        "along_x": [[1.0, 0.0, 0.0]],
        "minus_along_x": [[-1.0, 0.0, 0.0]],
        "along_y": [[0.0, 1.0, 0.0]],
        "along_z": [[0.0, 0.0, 1.0]],
        "down": np.array([[0.0, 0.0, -1.0]]),
        "crossed": np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
        "onto_map": onto_map,
        "largest_depth": model.largest_depth,
        "light_depth": LIGHT * model.largest_depth,
        "few_patches": float(FEW_PATCHES),
        "low": model.places[0].copy(),
        "high": model.places[1].copy(),
    }
    constants |= {f"bit_{name}": bit for name, bit in bits.items()}
    for axis, step in ((1, -model.size[1]), (2, model.size[0])):
        length, margin = model.covered.shape[axis - 1], np.zeros(6, dtype=np.int64)
        margin[[axis, 3 + axis]] = 1
        constants |= {
            f"axis_{axis}": [axis],
            f"zero_{axis}": [0],
            f"but_two_{axis}": [length - 2],
            f"but_one_{axis}": [length - 1],
            f"end_{axis}": [length],
            f"margin_{axis}": margin,
            f"wide_margin_{axis}": 2 * margin,
            f"step_{axis}": step,
            **{f"past_{name}_{axis}": [length + number] for number, name in enumerate(("one", "two", "three"), 1)},
        }
    return constants
