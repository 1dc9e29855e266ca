"""The process in which a user's geometry is meshed: arrays come in at standard input and leave at standard output.

It is run as a file, with the name of a task and its limits (bytes, seconds), and imports nothing of this package.
"""

from __future__ import annotations

import ctypes
import io
import mmap
import os
import platform
import resource
import signal
import sys
import tempfile
import types
from collections.abc import Callable
from typing import Any


def main(task: str, memory: int, seconds: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Of a parent that is killed outright nothing is heard.
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
    signal.alarm(seconds + 10)
    # fTetWild writes its surface into the working directory; in one that is gone it cannot.
    folder = tempfile.mkdtemp()
    os.chdir(folder)
    os.rmdir(folder)
    # Standard output is for the answer alone, whatever the libraries print.
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)

    import numpy as np

    tasks: dict[str, Callable[..., dict[str, Any]]] = {"tetrahedralise": _tetrahedralise, "mesh_step": _mesh_step}
    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as arrays:
        result = tasks[task](**arrays)
    np.savez(answer, **result)
    answer.close()
    # Some of the libraries' threads do not survive an orderly end.
    os._exit(0)


def _tetrahedralise(vertices: Any, triangles: Any, mesh_size: Any, epsilon: Any) -> dict[str, Any]:
    """Straight tetrahedra within ``epsilon`` mm of a surface (fTetWild: Hu et al. 2020)."""
    import numpy as np

    _fix_random_device()
    # The package looks for PyVista on import, without need.
    sys.modules["pyvista"] = types.ModuleType("pyvista")
    from pytetwild import tetrahedralize

    points, tets = tetrahedralize(
        vertices,
        triangles.astype(np.int32),
        edge_length_abs=float(mesh_size),
        epsilon=float(epsilon) / float(np.linalg.norm(np.ptp(vertices, axis=0))),
        simplify=False,
    )
    return {"points": points, "tets": tets}


def _fix_random_device() -> None:
    """Let C++'s ``std::random_device`` give a constant in this process.

    fTetWild inserts the triangles in an order drawn from it, and offers no seed: every run would give another mesh.
    Where the processor is another one or the system does not allow it, that is so.
    """
    constant = {
        "x86_64": bytes.fromhex("f30f1efa b82a000000 c3"),  # endbr64; mov eax, 42; ret
        "aarch64": bytes.fromhex("40058052 c0035fd6"),  # mov w0, 42; ret
    }.get(platform.machine())
    if constant is None:
        return
    function = ctypes.CDLL("libstdc++.so.6")._ZNSt13random_device9_M_getvalEv
    address = ctypes.cast(function, ctypes.c_void_p).value or 0
    start = address - address % mmap.PAGESIZE
    length = ctypes.c_size_t(address + len(constant) - start)
    protect = ctypes.CDLL(None).mprotect
    if protect(ctypes.c_void_p(start), length, mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC) == 0:
        ctypes.memmove(address, constant, len(constant))
        protect(ctypes.c_void_p(start), length, mmap.PROT_READ | mmap.PROT_EXEC)


def _mesh_step(
    path: Any, mesh_size: Any, rim_refinement: Any, curvature_safety: Any, most_elements: Any
) -> dict[str, Any]:
    """Curved tetrahedra of the body in a STEP file, finer along the edges on the board (Netgen).

    A body too large for ``most_elements`` is not meshed: its volume alone comes back.
    """
    import numpy as np
    from netgen.meshing import MeshingParameters
    from netgen.occ import OCCGeometry

    try:
        solids = list(OCCGeometry(str(path)).shape.solids)
    except Exception as error:
        return {"flaw": f"it cannot be read as STEP ({' '.join(str(error).split())[:100]})"}
    if len(solids) != 1:
        return {"flaw": f"it holds {len(solids)} solids; one is needed"}
    solid, size = solids[0], float(mesh_size)
    if 8 * solid.mass / size**3 > most_elements:
        return {"volume": solid.mass}
    for edge in solid.edges:
        if edge.bounding_box[1].z < 1e-4 * solid.bounding_box[1].z:
            edge.maxh = size / float(rim_refinement)
    parameters = MeshingParameters(
        maxh=size, grading=0.4, curvaturesafety=float(curvature_safety), parallel_meshing=False
    )
    mesh = OCCGeometry(solid).GenerateMesh(parameters)
    mesh.SecondOrder()
    surface = mesh.Elements2D().NumPy()
    return {
        "volume": solid.mass,
        "points": np.array(mesh.Coordinates(), dtype=float),
        "tets": mesh.Elements3D().NumPy()["nodes"],
        "faces": surface["nodes"],
        "face": surface["index"] - 1,
        "names": np.array([mesh.GetBCName(int(i)) for i in range(surface["index"].max())], dtype=str),
    }


if __name__ == "__main__":
    del sys.path[0]  # the folder of this file, whose modules would stand before others of the same name
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
