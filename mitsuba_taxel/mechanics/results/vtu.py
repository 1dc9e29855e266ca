"""Export of a deformed pad as a VTU file for ParaView."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import WriteError, replacing
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.assembly import Material
from mitsuba_taxel.mechanics.results.fields import NodalFields, nodal_fields


def write_vtu(
    file: str | Path,
    mesh: VolumeMesh,
    displacement: np.ndarray,
    pressure: np.ndarray,
    material: Material,
    overstress: np.ndarray | None = None,
    contact_pressure: np.ndarray | None = None,
) -> None:
    """Write the undeformed mesh as quadratic tetrahedra, with the fields of the deformed pad at its nodes.

    They are "displacement [mm]" (by which ParaView's filter Warp By Vector deforms the mesh), "mean stress [MPa]" (the
    pressure field, positive in tension), "von Mises stress [MPa]", "Cauchy stress [MPa]" (xx, yy, zz, xy, yz, xz),
    "volume ratio J" and "principal stretches" (the largest first); :class:`NodalFields` defines them. An existing file
    is replaced once the new one is complete; the same state gives the same bytes.

    Parameters
    ----------
    file : str or Path
        Path, ending in .vtu.
    mesh : VolumeMesh
        Undeformed mesh.
    displacement : (N, 3) ndarray
        Displacement of each node, in mm.
    pressure : (corners,) ndarray
        Pressure at the corners of elements in MPa, positive in tension.
    material : Material
        Elastic law of the silicone.
    overstress : (m, q, 6) ndarray, optional
        Overstress of a viscoelastic silicone in MPa, see :attr:`ViscoelasticMemory.overstress`.
    contact_pressure : (N,) ndarray, optional
        Result of :func:`contact_pressure` for a state under an indenter in MPa, written as "contact pressure [MPa]".

    Raises
    ------
    InputError
        if ``file`` does not end in .vtu, or cannot be written.
    """
    file = Path(file)
    if file.suffix.lower() != ".vtu":
        raise InputError(f"output {file} must end in .vtu.")
    data = _point_data(mesh, displacement, nodal_fields(mesh, displacement, pressure, material, overstress))
    if contact_pressure is not None:
        data["contact pressure [MPa]"] = contact_pressure
    import meshio  # slow to import, with readers of forty formats

    try:
        with replacing(file) as temporary:
            meshio.vtu.write(temporary, meshio.Mesh(mesh.points, [("tetra10", mesh.tets)], point_data=data))
    except WriteError as error:
        raise InputError(f"output {file} cannot be written: {error.reason}.") from error


def _point_data(mesh: VolumeMesh, displacement: np.ndarray, fields: NodalFields) -> dict[str, np.ndarray]:
    rows, columns = [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]  # VTK's order of a symmetric tensor
    return {
        "displacement [mm]": displacement,
        "mean stress [MPa]": fields.pressure,
        "von Mises stress [MPa]": fields.von_mises_stress,
        "Cauchy stress [MPa]": fields.cauchy_stress[:, rows, columns],
        "volume ratio J": fields.volume_ratio,
        "principal stretches": fields.principal_stretches,
    }
