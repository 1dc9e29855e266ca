"""Solutions by CalculiX (`ccx`): its ten-node tetrahedron C3D10 and its neo-Hookean law, on the meshes of this package
under the same nodal forces."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.evidence.peers.displacement_form import bulk_modulus, held, nodal_forces
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.materials.laws import NeoHookean

_JOB = "pad"
SOLVERS = ("SPOOLES", "ITERATIVE CHOLESKY", "ITERATIVE SCALING")
"""Linear solvers of CalculiX, by the names of its input: a direct one, its default, and conjugate gradients with an
incomplete Cholesky factor or with the diagonal as preconditioner."""


@dataclass(frozen=True)
class CalculixRun:
    """Result of one run of CalculiX.

    Attributes
    ----------
    displacement : (N, 3) ndarray
        Displacement of each of N nodes in mm, with the seven digits that CalculiX prints.
    force : (3,) ndarray
        Force in N on the moved body; NaN without a body.
    held : (k,) ndarray of int
        Nodes of the board whose forces the program printed; empty if it did not.
    held_force : (k, 3) ndarray
        Force of the board on these nodes in N.
    seconds : float
        Wall time in s of the whole process: reading the input, solving, and writing the displacements.
    increments : int
        Number of load increments.
    iterations : int
        Number of Newton iterations, including those of abandoned increments.
    """

    displacement: np.ndarray
    force: np.ndarray
    held: np.ndarray
    held_force: np.ndarray
    seconds: float
    increments: int
    iterations: int


def installed() -> bool:
    """Whether `ccx` is installed."""
    return shutil.which("ccx") is not None


def require() -> None:
    """Raise `ComputationError` if CalculiX is not installed."""
    if not installed():
        raise ComputationError("ccx (CalculiX) is not installed: install it for this comparison.")


def solve(
    mesh: VolumeMesh,
    material: NeoHookean,
    force: Sequence[float],
    threads: int = 1,
    solver: str = SOLVERS[0],
    seconds: float | None = None,
) -> CalculixRun:
    """Compute, by CalculiX, the deformation of a pad that is glued to the board, under a dead load spread over its
    undeformed top.

    Load increments and tolerances are the defaults of CalculiX: the whole load at once, reduced if this fails.

    Parameters
    ----------
    mesh : VolumeMesh
        The undeformed mesh.
    material : NeoHookean
        The law.
    force : sequence of float
        Total force (Fx, Fy, Fz) in N.
    threads : int
        Number of threads of CalculiX.
    solver : str
        Linear solver, one of :data:`SOLVERS`.
    seconds : float, optional
        Longest wall time in s; by default there is no limit.

    Raises
    ------
    InputError
        if the material is incompressible.
    ComputationError
        if CalculiX ends before the whole load is applied, or takes longer.
    """
    return run(deck(mesh, material, force, solver), len(mesh.points), threads, seconds)


def run(text: str, nodes: int, threads: int = 1, limit: float | None = None) -> CalculixRun:
    """Run CalculiX on an input text.

    Parameters
    ----------
    text : str
        Input of CalculiX. It must print the displacements of the pad's nodes, and may print a total force last.
    nodes : int
        Number of these nodes.
    threads : int
        Number of threads of CalculiX.
    limit : float, optional
        Longest wall time in s; by default there is no limit.

    Returns
    -------
    CalculixRun
        Results of the run.

    Raises
    ------
    ComputationError
        if CalculiX fails, or does not end in this time.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.joinpath(f"{_JOB}.inp").write_text(text, encoding="utf-8")
        environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}
        start = time.perf_counter()
        try:
            process = subprocess.run(
                ["ccx", _JOB], cwd=folder, env=environment, capture_output=True, text=True, timeout=limit
            )
        except subprocess.TimeoutExpired:
            raise ComputationError(f"ccx did not end within {limit:g} s.") from None
        seconds = time.perf_counter() - start
        if process.returncode:
            raise ComputationError(f"ccx stopped: {_complaint(process.stdout + process.stderr)}.")
        status, convergence = (_rows(folder / f"{_JOB}.{kind}") for kind in ("sta", "cvg"))
        increments = sum(not row[2].endswith("U") for row in status)  # U: given up
        table = folder / f"{_JOB}.dat"
        displacement, force, on_board = read_displacement(table, nodes), read_force(table), read_board_forces(table)
        return CalculixRun(displacement, force, *on_board, seconds, increments, len(convergence))


def deck(mesh: VolumeMesh, material: NeoHookean, force: Sequence[float], solver: str = SOLVERS[0]) -> str:
    """Input text of CalculiX for :func:`solve`: a pad under a dead load spread over its top."""
    load = nodal_forces(mesh, force)
    lines = pad_lines(mesh, material)
    lines += ["*STEP, NLGEOM", f"*STATIC, SOLVER={solver}", "*CLOAD"]
    lines += [f"{n + 1},{axis + 1},{load[n, axis]:.13e}" for n, axis in np.argwhere(load)]
    lines += ["*NODE PRINT, NSET=PAD, FREQUENCY=1000000", "U", "*END STEP", ""]  # after the last increment only
    return "\n".join(lines)


def pad_lines(mesh: VolumeMesh, material: NeoHookean) -> list[str]:
    """Lines of a CalculiX input that define the pad: its material, and the sets PAD of its nodes and of its elements.
    """
    lines = ["*NODE, NSET=PAD", *node_lines(mesh.points, 1), "*ELEMENT, TYPE=C3D10, ELSET=PAD"]
    lines += [",".join(map(str, (n, *nodes))) for n, nodes in enumerate(mesh.tets + 1, start=1)]
    lines += ["*MATERIAL, NAME=SILICONE", "*HYPERELASTIC, NEO HOOKE"]
    lines += [f"{0.5 * material.shear_modulus:.13e},{2 / bulk_modulus(material):.13e}"]
    lines += ["*SOLID SECTION, ELSET=PAD, MATERIAL=SILICONE", "*BOUNDARY"]
    return lines + [f"{n},1,3" for n in np.flatnonzero(held(mesh)) + 1]


def node_lines(points: np.ndarray, first: int) -> list[str]:
    """Lines of a CalculiX input that define nodes.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions of N nodes in mm.
    first : int
        Number of the first node.
    """
    return [f"{n},{x:.13e},{y:.13e},{z:.13e}" for n, (x, y, z) in enumerate(points, start=first)]


def read_displacement(file: Path, nodes: int) -> np.ndarray:
    """Read the displacements (N, 3) in mm of nodes 1 to N from the first table of displacements in a `.dat` file.

    Version 2.23 prints the step and the increment before the table, older versions do not.
    """
    lines = file.read_text(encoding="utf-8").splitlines()
    heading = next(number for number, line in enumerate(lines) if line.startswith(" displacements"))
    return np.loadtxt(lines[heading + 2 :], usecols=(1, 2, 3), ndmin=2, max_rows=nodes)


def read_force(file: Path) -> np.ndarray:
    """Read the total force (3,) in N at the end of a `.dat` file; NaN if there is none."""
    _, _, total = file.read_text(encoding="utf-8").partition("total force")
    return np.array(total.split()[-3:], dtype=float) if total else np.full(3, np.nan)


def read_board_forces(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (k,) of the set BOARD and the forces (k, 3) in N on them, which a `.dat` file ends with; empty if it holds
    none."""
    _, _, rows = file.read_text(encoding="utf-8").partition("forces (fx,fy,fz) for set BOARD")
    numbers = np.array([row.split() for row in rows.splitlines()[1:] if row], dtype=float).reshape(-1, 4)
    return numbers[:, 0].astype(int) - 1, numbers[:, 1:]


def _rows(file: Path) -> list[list[str]]:
    """Iterate over the lines of a file that start with a number, split into words."""
    lines = [line.split() for line in file.read_text(encoding="utf-8").splitlines()]
    return [row for row in lines if row and row[0].isdigit()]


def _complaint(output: str) -> str:
    """First error message in the output of CalculiX, as one line."""
    _, _, message = output.partition("*ERROR")
    return " ".join(message.split("\n\n")[0].lstrip(": ").split()) or "it names no reason"
