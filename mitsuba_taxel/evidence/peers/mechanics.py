"""Tables on the mechanics of pads: error against time compared with CalculiX, the paper's load paths, growth with the
number of cells, and time by component.

Every time is measured in a separate process, with an empty cache of solutions.
"""

from __future__ import annotations

import math
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
from threadpoolctl import threadpool_limits

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.processes.system import peak_memory
from mitsuba_taxel.evidence.peers import calculix
from mitsuba_taxel.evidence.peers.elements import CELL, mean_roof_displacement
from mitsuba_taxel.geometry.mirror import ACROSS_Y, MIRRORS
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    NeoHookean,
    PlateDisplacement,
    SpreadForce,
    load_path,
)
from mitsuba_taxel.mechanics.elements.solvers import Rslab, available_solvers
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.locate import displacement_at
from mitsuba_taxel.pads import CELL_SHAPES, REGIONS, Pad, mesh_pad
from mitsuba_taxel.pads.parametric.pad import DEFAULT_MESH_SIZE

MATERIAL = NeoHookean()
FORCE = (0.0, 0.0, -20.0)
OBLIQUE_FORCE = (0.5, 0.0, -5.0)
NORMAL = [(0.0, 0.0, -0.5 * step) for step in range(41)]
TANGENTIAL = [(0.5 * step, 0.0, -8.0) for step in range(17)]
REFERENCE_SIZE = 0.28
"""Mesh size in mm of the reference under a normal load, which needs only an eighth of the pad."""
TANGENTIAL_REFERENCE_SIZE = 0.5
"""Mesh size in mm of the reference under a tangential load, which needs half of the pad."""
COMPARED_SIDES = (3, 6)
"""Rows and columns of cells of the pads that CalculiX solves too."""
PEER_SECONDS = 3600.0
"""Longest wall time in s of a solution by CalculiX."""


def solve_table() -> Iterator[tuple[object, ...]]:
    """Table of the error of the centre roof's mean displacement under a normal load, and the seconds from pad to
    displacement, of this package and of CalculiX."""
    pad = Pad()
    truth = _isolated(_own, pad, REFERENCE_SIZE, True, "rslab")[0]
    yield "system", "mesh size", "seconds", "MB", "roof mm", "error"

    def row(system: str, size: float, roof: float, seconds: float, memory: float) -> tuple[object, ...]:
        return system, size, f"{seconds:.2f}", f"{memory:.0f}", f"{roof:.6f}", f"{abs(roof / truth - 1):.2%}"

    cases: list[tuple[str, bool, str, tuple[float, ...]]] = [
        ("ours", True, "rslab", (2.0, 1.2, 0.8, 0.55, 0.4)),
        ("ours, SuperLU", True, "superlu", (2.0, 1.2, 0.8)),
        ("ours, whole pad", False, "rslab", (2.0, 1.2, 0.8)),
        ("ours, whole pad, SuperLU", False, "superlu", (2.0,)),
    ]
    for system, symmetric, solver, sizes in cases:
        for size in sizes:
            roof, seconds, memory = _isolated(_own, pad, size, symmetric, solver)
            yield row(system, size, roof, seconds, memory)
    if not calculix.installed():
        yield ("ccx is not installed", "", "", "", "", "")
        return
    for threads in (1, 2):
        for size in (2.0, 1.2, 0.8):
            try:
                yield row(f"ccx, {threads} threads", size, *_isolated(_peer, pad, size, threads))
            except ComputationError as reason:
                yield (f"ccx, {threads} threads", size, str(reason), "", "", "")


def _own(
    pad: Pad, size: float, symmetric: bool, solver: str, force: tuple[float, ...] = FORCE, cell: int = CELL
) -> tuple[float, float]:
    """Solve a pad with this package. Returns the mean displacement of the roof of a cell in mm, and the seconds
    including meshing."""
    start = time.perf_counter()
    mesh = mesh_pad(pad, size)
    images, mirrors = (node_images(mesh), MIRRORS) if symmetric else ({}, ())
    loaded = LoadedPad(mesh, MATERIAL, SpreadForce(), mirrors, images, solver)
    solution, _ = loaded.solve(np.zeros(loaded.unknowns), np.array(force))
    displacement = loaded.split(solution.unknowns)[0]
    return mean_roof_displacement(mesh, displacement, cell), time.perf_counter() - start


def _peer(
    pad: Pad,
    size: float,
    threads: int,
    solver: str = calculix.SOLVERS[0],
    force: tuple[float, ...] = FORCE,
    cell: int = CELL,
) -> tuple[float, float]:
    """Solve a pad with CalculiX on the same mesh. Returns the mean displacement of the roof of a cell in mm, and the
    seconds without meshing and without writing the input."""
    mesh = mesh_pad(pad, size)
    result = calculix.solve(mesh, MATERIAL, force, threads, solver, PEER_SECONDS)
    return mean_roof_displacement(mesh, result.displacement, cell), result.seconds


def paths_table() -> Iterator[tuple[object, ...]]:
    """Table of the paper's load paths: seconds and memory without caches, and the error of the last step compared with
    a finer mesh."""
    yield "cells", "path", "steps", "seconds", "MB", "stated error", "largest error", "rms error", "between nodes"
    for cell in CELL_SHAPES:
        for name, steps, size in (
            ("normal", NORMAL, REFERENCE_SIZE),
            ("tangential", TANGENTIAL, TANGENTIAL_REFERENCE_SIZE),
        ):
            seconds, stated_error, memory = _isolated(_path, Pad(cell), steps)
            largest, rms, between, _ = _isolated(_path_errors, Pad(cell), steps[-1], size)
            errors = f"{stated_error:.2%}", f"{largest:.2%}", f"{rms:.2%}", f"{between:.4%}"
            yield cell, name, len(steps), f"{seconds:.1f}", f"{memory:.0f}", *errors


def _path(pad: Pad, steps: list[tuple[float, ...]]) -> tuple[float, float]:
    """Solve a load path. Returns the seconds, and the stated relative error of the last step."""
    start = time.perf_counter()
    states = load_path(pad, MATERIAL, steps)
    error = states[-1].error
    return time.perf_counter() - start, error.relative if error else float("nan")


def _path_errors(pad: Pad, last: tuple[float, ...], size: float) -> tuple[float, float, float]:
    """Errors of the displacement of the roofs' nodes under the last force, relative to their largest displacement.

    Returns the largest and the root mean square error, compared with a finer mesh, and the largest error of
    interpolation along the path, compared with a solution at exactly this force.
    """
    # The interpolated state, and a solve at the same force.
    state = load_path(pad, MATERIAL, [last])[0]
    images = node_images(state.mesh)
    group = tuple(mirror for mirror in images if np.array_equal(mirror.image(np.array(last)), last))
    loaded = LoadedPad(state.mesh, MATERIAL, SpreadForce(), group, images)
    exact, _ = loaded.solve(loaded.gather(state.displacement, state.pressure), np.array(last))
    # The reference on a finer mesh, at the nodes of the roofs.
    fine = load_path(pad, MATERIAL, [last], mesh_size=size)[0]
    roof = np.unique(state.mesh.faces[state.mesh.face_region == REGIONS["roof"]])
    reference = displacement_at(fine.mesh, fine.displacement, state.mesh.points[roof], tolerance=0.1)
    error = np.linalg.norm(state.displacement[roof] - reference, axis=1)
    interpolation_error = np.linalg.norm(state.displacement - loaded.split(exact.unknowns)[0], axis=1)[roof]
    largest = np.linalg.norm(reference, axis=1).max()
    return error.max() / largest, float(np.sqrt(np.mean(error**2))) / largest, interpolation_error.max() / largest


def cells_table() -> Iterator[tuple[object, ...]]:
    """Table of seconds and memory of a load path to the same pressure, for several numbers of cells; and of one
    solution by this package and by CalculiX with direct and iterative solvers, on the same mesh."""
    yield "cells", "load", "unknowns", "seconds", "MB", "roof mm"
    timings: dict[str, list[tuple[int, float, float]]] = {"normal": [], "tangential": []}
    for load, sides in (("normal", (1, 2, 3, 6, 9, 12)), ("tangential", (1, 2, 3, 4, 6))):
        for side in sides:
            unknowns, seconds, memory = _isolated(_grown, side, load)
            timings[load].append((side * side, seconds, memory))
            yield f"{side} x {side}", load, unknowns, f"{seconds:.1f}", f"{memory:.0f}", ""
    # Extrapolate by a power law through the three largest pads.
    for load, rows in timings.items():
        cells, seconds, memory = np.log(np.array(rows[-3:], dtype=float)).T
        for quantity, figures in (("seconds", seconds), ("MB", memory)):
            exponent, offset = np.polyfit(cells, figures, 1)
            at_32 = np.exp(offset + exponent * np.log(32 * 32))
            yield f"{load}: {quantity} ~ cells^{exponent:.2f}", f"32 x 32 would take {at_32:.0f}", "", "", "", ""
    for side in COMPARED_SIDES:
        yield from _compared_programs(side)


def _compared_programs(side: int) -> Iterator[tuple[object, ...]]:
    """Rows for one solution of ``side`` x ``side`` cells under a normal load, on the default mesh, by this package with
    and without the symmetry of the pad, and by each solver of CalculiX, which ignores symmetry."""
    pad = Pad(rows=side, columns=side)
    size, force = pad.default_mesh_size, _grown_force(pad, "normal")
    middle = side // 2 * side + side // 2 + 1
    systems: dict[str, tuple[object, ...]] = {
        "ours": (_own, pad, size, True, "rslab", force, middle),
        "ours, whole pad": (_own, pad, size, False, "rslab", force, middle),
    }
    if calculix.installed():
        for solver in calculix.SOLVERS:
            systems[f"ccx, {solver.lower()}"] = _peer, pad, size, 1, solver, force, middle
    for system, (function, *arguments) in systems.items():
        try:
            assert callable(function)
            roof, seconds, memory = _isolated(function, *arguments)
            yield f"{side} x {side}", f"normal: {system}", "", f"{seconds:.1f}", f"{memory:.0f}", f"{roof:.6f}"
        except ComputationError as reason:
            yield f"{side} x {side}", f"normal: {system}", str(reason), "", "", ""
    if not calculix.installed():
        yield f"{side} x {side}", "ccx is not installed", "", "", "", ""


def _grown_force(pad: Pad, load: str) -> tuple[float, float, float]:
    """Force in N of the same pressure on pads of any size: 20 N on 3 x 3 cells if it is normal."""
    pressure = 20 / (9.65 * 9.65) * pad.extent[0] * pad.extent[1]
    return (0.0, 0.0, -pressure) if load == "normal" else (0.2 * pressure, 0.0, -0.4 * pressure)


def _grown(side: int, load: str) -> tuple[int, float]:
    """Solve a pad of ``side`` x ``side`` cells under a pressure that is the same for all sizes. Returns the number of
    unknowns and the seconds."""
    pad = Pad(rows=side, columns=side)
    force = _grown_force(pad, load)
    start = time.perf_counter()
    state = load_path(pad, MATERIAL, [force])[0]
    return 3 * len(state.mesh.points) + state.mesh.corner_count, time.perf_counter() - start


def parts_table() -> Iterator[tuple[object, ...]]:
    """Table of the CPU seconds of 41 normal load steps to a fixed force per cell, with their stated error, and the
    fractions of time of each component."""
    yield "cells", "steps", "CPU seconds", "factorisation", "stability", "second mesh", "MB"
    for side in (1, 3, 6):
        total, *components, memory = _isolated(_parts, Pad(rows=side, columns=side), NORMAL)
        shares = [f"{component / total:.0%}" for component in components]
        yield f"{side} x {side}", len(NORMAL), f"{total:.1f}", *shares, f"{memory:.0f}"


def _parts(pad: Pad, steps: list[tuple[float, ...]]) -> tuple[float, float, float, float]:
    """Measure a load path: CPU seconds in total, of matrix factorisations, of stability tests, and of the second mesh.
    """
    fraction = len(pad.cell_centres) / 9
    values = [tuple(fraction * component for component in step) for step in steps]
    start = time.process_time()
    with _clocked(Rslab, "factor") as factors, _clocked(LoadedPad, "refuse_unstable") as checks:
        states = load_path(pad, MATERIAL, values)
        solved = time.process_time()
        _ = states[-1].error
    end = time.process_time()
    return end - start, sum(factors), sum(checks), end - solved


def contact_table() -> Iterator[tuple[object, ...]]:
    """Table of the number of factorisations for indenters on a cell, relative to that for a bonded plate.

    A ball beside the centre has no symmetry, and is compared with a plate on a leaning cell. Factorisations for the
    test of stability against asymmetric displacements are not counted, because their number is the same in all cases.
    """
    yield "pressed by", "mm", "factorisations", "per mm", "relative to a plate", "CPU seconds"
    cell, ball, down = Pad("hemispheric", rows=1, columns=1), Indenter("sphere", radius=2.5), (0.0, 0.0, -0.8)
    rows: list[tuple[str, Pad, Indenter | None, tuple[float, ...]]] = [
        ("a plate", cell, None, down),
        ("a ball of 2.5 mm", cell, ball, down),
        ("a rod of 1 mm", cell, Indenter("cylinder", radius=1.0), down),
        ("a punch of 1.5 mm", cell, Indenter("punch", radius=1.5), (0.0, 0.0, -0.6)),
        ("a ball dragged by 0.2 mm, friction of 0.3", cell, replace(ball, friction=0.3), (0.2, 0.0, -0.5)),
        ("a plate, without symmetry", replace(cell, top_x=0.2, top_y=0.1), None, down),
        ("a ball off the centre", cell, replace(ball, at=(0.8, 0.5)), down),
    ]
    of_plate = math.nan
    for name, pad, body, path in rows:
        count, seconds, _ = _isolated(_factorisations, pad, body, path)
        per_mm = count / np.abs(path).sum()
        of_plate = per_mm if body is None else of_plate
        yield name, f"{np.abs(path).sum():g}", count, f"{per_mm:.1f}", f"{per_mm / of_plate:.2f}", f"{seconds:.1f}"


def _factorisations(pad: Pad, body: Indenter | None, path: tuple[float, ...]) -> tuple[int, float]:
    """Solve a displacement of an indenter, or of a plate if ``body`` is None. Returns the number of matrix
    factorisations and the CPU seconds."""
    load = PlateDisplacement() if body is None else IndenterDisplacement(body)
    start = time.process_time()
    with _clocked(LoadedPad, "_factored") as factors:
        load_path(pad, MATERIAL, [path], load=load, mesh_size=DEFAULT_MESH_SIZE)
    return len(factors), time.process_time() - start


@contextmanager
def _clocked(owner: type, method: str) -> Iterator[list[float]]:
    """Context manager: record the CPU seconds of each call of a method of a class."""
    original, times = getattr(owner, method), []

    def clocked(*arguments: object) -> object:
        start = time.process_time()
        try:
            return original(*arguments)
        finally:
            times.append(time.process_time() - start)

    setattr(owner, method, clocked)
    try:
        yield times
    finally:
        setattr(owner, method, original)


def solvers_table() -> Iterator[tuple[object, ...]]:
    """Table of the CPU seconds of one load with each available linear solver, on 3 x 3 cells of each shape, with one
    thread.

    The difference between solvers is that of the displacements, relative to the largest displacement.
    """
    yield "cells", "solver", "unknowns", "CPU seconds", "relative", "difference", "MB"
    for cell in CELL_SHAPES:
        solved = [(name, *_isolated(_solved_by, name, cell)) for name in available_solvers()]
        _, reference, _, shortest, _ = solved[0]
        for name, displacement, unknowns, seconds, memory in solved:
            difference = np.abs(displacement - reference).max() / np.abs(reference).max()
            figures = f"{seconds:.2f}", f"{seconds / shortest:.1f}", f"{difference:.0e}", f"{memory:.0f}"
            yield cell, name, unknowns, *figures


def _solved_by(solver: str, cell: str) -> tuple[np.ndarray, int, float]:
    """Solve a pad with one linear solver. Returns displacements in mm, number of unknowns, and CPU seconds without
    meshing (the smaller of two runs).

    The load is symmetric, so that half of the pad is solved; stability is tested.
    """
    pad = Pad(cell)
    mesh, seconds = mesh_pad(pad, pad.default_mesh_size), math.inf
    for _ in range(2):
        loaded = LoadedPad(mesh, MATERIAL, SpreadForce(), (ACROSS_Y,), node_images(mesh), solver)
        with threadpool_limits(1):
            start = time.process_time()
            solution, _ = loaded.solve(np.zeros(loaded.unknowns), np.array(OBLIQUE_FORCE))
            seconds = min(seconds, time.process_time() - start)
    return loaded.split(solution.unknowns)[0], loaded.unknowns, seconds


TABLES: dict[str, Callable[[], Iterator[tuple[object, ...]]]] = {
    "solve": solve_table,
    "paths": paths_table,
    "cells": cells_table,
    "parts": parts_table,
    "contact": contact_table,
    "solvers": solvers_table,
}


def _isolated(function: Callable, *arguments: object) -> tuple:
    """Call a function in a separate process. Returns its result, and the peak memory in MB."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(_measured, function, arguments).result()


def _measured(function: Callable, arguments: tuple) -> tuple:
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MITSUBA_TAXEL_CACHE"] = folder
        result = function(*arguments)
    return *result, peak_memory(of_children=True)
