"""The process in which a user's geometry is meshed; arrays come on standard input and leave on standard output.

It is run as a script, with the name of a task and its limits (bytes, seconds), and does not import this package."""

from __future__ import annotations

import io
import os
import runpy
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

SYSTEM = Path(__file__).parents[2] / "base" / "processes" / "system.py"
"""Script that is run rather than imported: an import would load this package, and with it Mitsuba."""

UNITS_OF_HEIGHT, SURVEY_UNITS = 4.0, 20.0
"""Height of a body during meshing, diagonal during its survey: Netgen has absolute tolerances."""


def main(task: str, memory: int, seconds: int) -> None:
    system = runpy.run_path(str(SYSTEM))
    system["confine"](memory)
    system["stop_after"](seconds + 10)
    # fTetWild would write its surface into the working directory: give it a deleted one.
    folder = tempfile.mkdtemp()
    os.chdir(folder)
    _remove(folder)
    # Keep output of the libraries out of standard output, which carries the result.
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)

    import numpy as np

    tasks: dict[str, Callable[..., dict[str, Any]]] = {
        "fill": _fill,
        "tetrahedralise": _tetrahedralise,
        "survey_step": _survey_step,
        "mirrors_of_step": _mirrors_of_step,
        "mesh_step": _mesh_step,
    }
    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as arrays:
        result = tasks[task](**arrays)
    np.savez(answer, **result)
    answer.close()
    os.chdir(tempfile.gettempdir())
    _remove(folder)
    # An orderly exit crashes in threads of some libraries.
    os._exit(0)


def _remove(folder: str) -> None:
    """Remove a folder if that is possible: Windows keeps the working directory."""
    shutil.rmtree(folder, ignore_errors=True)


def _fill(vertices: Any, triangles: Any, mesh_size: Any) -> dict[str, Any]:
    """Fill a closed surface with straight tetrahedra by Netgen; the triangles of the surface are kept."""
    import numpy as np
    from netgen.meshing import FaceDescriptor, Mesh, MeshingParameters

    mesh = Mesh()
    mesh.Add(FaceDescriptor(surfnr=1, domin=1, domout=0, bc=1))
    mesh.AddPoints(np.ascontiguousarray(vertices))
    mesh.AddElements(dim=2, index=1, data=np.ascontiguousarray(triangles.astype(np.int32)), base=0)
    mesh.GenerateVolumeMesh(MeshingParameters(maxh=float(mesh_size), grading=0.4, parallel_meshing=False))
    return {
        "points": np.array(mesh.Coordinates(), dtype=float),
        "tets": mesh.Elements3D().NumPy()["nodes"][:, :4].astype(np.int64) - 1,
    }


def _tetrahedralise(vertices: Any, triangles: Any, mesh_size: Any, epsilon: Any) -> dict[str, Any]:
    """Fill a surface with straight tetrahedra by fTetWild (Hu et al. 2020); the boundary lies within ``epsilon`` mm of
    the surface."""
    import numpy as np

    # Python does not search the folder of this script if `taxel` has set PYTHONSAFEPATH.
    sys.path.append(os.path.dirname(os.path.abspath(__file__)))
    from ftetwild import tetrahedralize  # beside this script

    points, tets = tetrahedralize(
        vertices,
        triangles.astype(np.int32),
        edge_length_abs=float(mesh_size),
        epsilon=float(epsilon) / float(np.linalg.norm(np.ptp(vertices, axis=0))),
        simplify=False,
    )
    return {"points": points, "tets": tets}


def _solids_in(path: Any, scale: Any, turn: Any, centred: Any) -> tuple[list[Any], list[str]]:
    """Solids in a STEP file in mm, turned by a rotation (3, 3), and names of the faces of the first.

    With ``centred``, the box around the solid is centred at x = y = 0, and its lowest vertex lies at z = 0."""
    import numpy as np
    from netgen.occ import Axis, OCCGeometry, Pnt, Vec

    # The reader knows a format by its ending, in small letters.
    with tempfile.TemporaryDirectory() as folder:
        copy = os.path.join(folder, "solid.step")
        try:
            os.symlink(str(path), copy)
        except OSError:  # Windows allows few users to make links
            shutil.copyfile(str(path), copy)
        solids = list(OCCGeometry(copy).shape.solids)
    if len(solids) != 1:
        return solids, []
    solid, names = solids[0], [face.name or "" for face in solids[0].faces]
    if scale != 1:
        solid = solid.Scale(Pnt(0, 0, 0), float(scale))
    if centred:
        angle = float(np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))))
        axis = [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
        if angle:
            solid = solid.Rotate(Axis(Pnt(0, 0, 0), Vec(*(axis if np.any(axis) else [1.0, 0.0, 0.0]))), angle)
        low, high = solid.bounding_box
        lowest = min(vertex.p.z for vertex in solid.vertices)
        solid = solid.Move(Vec(-(low.x + high.x) / 2, -(low.y + high.y) / 2, -lowest))
    return [solid], names


def _survey_step(path: Any, scale: Any, turn: Any, centred: Any, curvature_safety: Any) -> dict[str, Any]:
    """Triangles of the surface of the solid in a STEP file, the faces that they follow, and its volume (Netgen)."""
    import numpy as np
    from netgen.meshing import MeshingParameters, MeshingStep
    from netgen.occ import OCCGeometry, Pnt

    try:
        solids, names = _solids_in(path, scale, turn, centred)
    except Exception as error:
        return {"error": f"it cannot be read as STEP ({' '.join(str(error).split())[:100]})"}
    if len(solids) != 1:
        return {"error": f"it holds {len(solids)} solids; one is needed"}
    (solid,) = solids
    _number_faces(solid)
    low, high = solid.bounding_box
    unit = (high - low).Norm() / SURVEY_UNITS
    mesh = OCCGeometry(solid.Scale(Pnt(0, 0, 0), 1 / unit)).GenerateMesh(
        MeshingParameters(
            maxh=1.0,
            grading=0.4,
            curvaturesafety=float(curvature_safety),
            parallel_meshing=False,
            perfstepsend=MeshingStep.MESHSURFACE,
        )
    )
    surface = mesh.Elements2D().NumPy()
    return {
        "volume": solid.mass,
        "points": unit * np.array(mesh.Coordinates(), dtype=float),
        "triangles": surface["nodes"][:, :3].astype(np.int64) - 1,
        "face": _numbers_of_faces(mesh, surface["index"]),
        "names": np.array(names, dtype=str),
    }


def _mirrors_of_step(
    path: Any, scale: Any, turn: Any, centred: Any, region: Any, points: Any, at: Any, matrices: Any, tolerance: Any
) -> dict[str, Any]:
    """Mask of the mirrors (M, 3, 3) that map all points (N, 3) of the surface onto faces of the same region."""
    import numpy as np
    from netgen.occ import Compound, Pnt, Vertex

    (solid,), _ = _solids_in(path, scale, turn, centred)
    faces = list(solid.faces)
    faces_by_region = {code: Compound([faces[k] for k in np.flatnonzero(region == code)]) for code in np.unique(at)}

    def keeps(matrix: Any) -> bool:
        return all(
            faces_by_region[code].Distance(Vertex(Pnt(*point))) <= tolerance
            for code, point in zip(at, points @ matrix.T, strict=True)
        )

    return {"kept": np.array([keeps(matrix) for matrix in matrices], dtype=bool)}


def _mesh_step(
    path: Any,
    scale: Any,
    turn: Any,
    centred: Any,
    planes: Any,
    mesh_size: Any,
    face_size: Any,
    edge_size: Any,
    singular: Any,
    curvature_safety: Any,
) -> dict[str, Any]:
    """Curved tetrahedra of the part of a STEP solid on the kept side of ``planes`` (M, 2), given by normals (Netgen).

    Each face has its own element size (F,), and so have the edges between the faces of a ``singular`` pair (S, 2). The
    faces along the planes have the number -1."""
    import numpy as np
    from netgen.meshing import MeshingParameters
    from netgen.occ import Axis, Box, OCCGeometry, Pnt, Z

    (solid,), _ = _solids_in(path, scale, turn, centred)
    _number_faces(solid)
    low, high = solid.bounding_box
    unit, reach = (high.z - low.z) / UNITS_OF_HEIGHT, 2 * (high - low).Norm()
    for x, y in planes:
        kept = Box(Pnt(0, -reach, -reach), Pnt(reach, reach, reach))
        kept.faces.name = "-1"
        solid = solid * kept.Rotate(Axis(Pnt(0, 0, 0), Z), float(np.degrees(np.arctan2(y, x))))
    solid = solid.Scale(Pnt(0, 0, 0), 1 / unit)
    around: dict[Any, list[int]] = {}
    for face in solid.faces:
        number = int(face.name)
        if number >= 0:
            face.maxh = float(face_size[number]) / unit
        for edge in face.edges:
            around.setdefault(edge, []).append(number)
    pairs = set(map(tuple, singular.tolist()))
    for edge in solid.edges:
        if tuple(sorted(around.get(edge, []))) in pairs:
            edge.maxh = float(edge_size) / unit
    parameters = MeshingParameters(
        maxh=float(mesh_size) / unit, grading=0.4, curvaturesafety=float(curvature_safety), parallel_meshing=False
    )
    mesh = OCCGeometry(solid).GenerateMesh(parameters)
    mesh.SecondOrder()
    surface = mesh.Elements2D().NumPy()
    return {
        "points": unit * np.array(mesh.Coordinates(), dtype=float),
        "tets": mesh.Elements3D().NumPy()["nodes"],
        "faces": surface["nodes"],
        "face": _numbers_of_faces(mesh, surface["index"]),
    }


def _number_faces(solid: Any) -> None:
    for number, face in enumerate(solid.faces):
        face.name = str(number)


def _numbers_of_faces(mesh: Any, index: Any) -> Any:
    """Numbers of the faces to which surface elements belong, from Netgen's ``index``; the number of a face is its
    name."""
    import numpy as np

    return np.array([int(mesh.GetBCName(int(i))) for i in range(index.max())])[index - 1]


if __name__ == "__main__":
    sys.path.append(sys.path.pop(0))  # the folder of this script, whose modules must not shadow others
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
