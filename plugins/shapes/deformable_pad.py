"""The silicone pad with its cells, deformed by a force on its top."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from mitsuba_taxel import stages
from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics.faces import similarity_scale
from mitsuba_taxel.optics.mesh_adapter import add_face_attribute, initialize_mesh
from mitsuba_taxel.optics.parameters import number, whole_number
from mitsuba_taxel.optics.parts import make_plugin
from mitsuba_taxel.pads import Pad

_PAD_LENGTHS = ("pitch", "wall", "height", "cell_size", "cell_height")


class DeformablePad(mi.Mesh):
    r"""
    .. _shape-deformable_pad:

    Deformable pad (:monosp:`deformable_pad`)
    -----------------------------------------

    .. pluginparameters::

     * - cell
       - |string|
       - Shape of the cells: :monosp:`parallelepiped`, :monosp:`cylindrical`, :monosp:`spherical` or
         :monosp:`hemispheric`. (Default: :monosp:`parallelepiped`)

     * - rows, columns
       - |int|
       - Number of cells; columns run along +x, rows from +y to -y. (Default: 3, 3)

     * - pitch
       - |float|
       - Distance between the centres of neighbouring cells, in mm. (Default: 3.55)

     * - wall
       - |float|
       - Thickness between an outermost cell and the outside, in mm. (Default: 1)

     * - height
       - |float|
       - Height of the pad, in mm. (Default: 4.55)

     * - cell_size
       - |float|
       - Side or diameter of a cell, in mm. (Default: 2.55)

     * - cell_height
       - |float|
       - From the board to the highest point of a cell, in mm. (Default: 1.55; spherical 1.6; hemispheric
         0.5 + cell_size / 2)

     * - youngs_modulus
       - |float|
       - Young's modulus at small strain, in MPa. (Default: 4.16)

     * - poisson_ratio
       - |float|
       - Poisson's ratio, up to 0.5. (Default: 0.49)

     * - force
       - |vector|
       - Total force on the top face, in N; compression is negative along z. (Default: 0, 0, 0)

     * - mesh_size
       - |float|
       - Size of the finite elements, in mm. (Default: 0.8)

     * - subdivision
       - |int|
       - Triangles along an edge of a finite element on the surface of a cell. (Default: 12)

     * - to_world
       - |transform|
       - Rigid motion, with at most a uniform scale, applied to the deformed pad. (Default: none)

     * - (nested)
       - |bsdf|
       - What the pad is made of, usually a `region`. (Default: absorbing)

    Solves for the deformation (or looks it up: solutions are kept on disk) and becomes the mesh of the deformed
    surface, with the face attributes :monosp:`face_region` and :monosp:`face_cell`. Its bottom is glued to z = 0.

    .. tabs::
        .. code-tab:: xml

            <shape type="deformable_pad">
                <string name="cell" value="hemispheric"/>
                <vector name="force" value="0, 0, -10"/>
            </shape>

        .. code-tab:: python

            'type': 'deformable_pad', 'cell': 'hemispheric', 'force': [0, 0, -10]
    """

    def __init__(self, props: mi.Properties) -> None:
        from mitsuba_taxel.mechanics import NeoHookean

        self.pad = _read_pad(props)
        self.material = NeoHookean(
            youngs_modulus=number(props, "youngs_modulus", 4.16, above=0),
            poisson_ratio=number(props, "poisson_ratio", 0.49, minimum=0, maximum=0.5),
        )
        self.force = tuple(float(component) for component in props.get("force", mi.ScalarVector3f(0, 0, 0)))
        if not np.all(np.isfinite(self.force)):
            raise InputError(f"force = {self.force} is not allowed: three finite numbers are needed.")
        self.mesh_size = number(props, "mesh_size", 0.8, above=0)
        self.subdivision = whole_number(props, "subdivision", 12, minimum=1, maximum=64)
        matrix = np.array(props.get("to_world", mi.ScalarTransform4f()).matrix, dtype=float)
        similarity_scale(matrix)
        if not any(isinstance(value, mi.BSDF) for _, value in props.objects()):
            props["bsdf"] = make_plugin("wall", scattering="absorbing")

        surface = self._solve()
        initialize_mesh(self, props, surface.vertices @ matrix[:3, :3].T + matrix[:3, 3], surface.triangles)
        add_face_attribute(self, "region", surface.region)
        add_face_attribute(self, "cell", surface.cell)

    def _solve(self):
        from mitsuba_taxel.mechanics import load_path, tessellate

        with stages.stage("mechanics"):
            self.state = load_path(self.pad, self.material, np.array([self.force]), mesh_size=self.mesh_size)[0]
            return tessellate(self.state, self.subdivision)

    def to_string(self) -> str:
        return f"DeformablePad[cell = {self.pad.cell}, force = {self.force} N]"


def _read_pad(props: mi.Properties) -> Pad:
    lengths = {name: number(props, name, above=0) for name in _PAD_LENGTHS if name in props}
    counts = {name: whole_number(props, name, 3, minimum=1, maximum=100) for name in ("rows", "columns")}
    return Pad(cell=props.get("cell", Pad.cell), rows=counts["rows"], columns=counts["columns"], **lengths)
