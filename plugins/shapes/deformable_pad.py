"""The silicone pad with its cells, deformed by a force on its top."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from mitsuba_taxel import stages
from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics.faces import similarity_scale
from mitsuba_taxel.optics.mesh_adapter import add_face_attribute, initialize_mesh
from mitsuba_taxel.optics.parameters import choice, number, whole_number
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

     * - finish
       - |string|
       - What the mould leaves on roof and side of the cells: :monosp:`smooth`, :monosp:`layer_steps`,
         :monosp:`grooves` or :monosp:`random`. (Default: :monosp:`smooth`)

     * - layer_height
       - |float|
       - With :monosp:`layer_steps`, which needs it: height of a printed layer, in mm.

     * - print_direction
       - |vector|
       - With :monosp:`layer_steps`: direction in which the mould was printed. (Default: 0, 0, 1)

     * - groove_pitch, groove_depth
       - |float|
       - With :monosp:`grooves`, which needs both: distance of the ridges along groove_direction, and the height from
         valley to ridge, in mm.

     * - groove_direction
       - |vector|
       - With :monosp:`grooves`: direction across the grooves. (Default: 1, 0, 0)

     * - rms_height, correlation_length
       - |float|
       - With :monosp:`random`, which needs both: standard deviation of the heights, and the distance at which their
         correlation has fallen to 1/e, in mm.

     * - roughness_seed
       - |int|
       - With :monosp:`random`: another number is another sample of the same roughness. (Default: 0)

     * - finish_refinement
       - |float|
       - With any finish but :monosp:`smooth`: least number of triangles' edges per layer height, groove pitch or
         correlation length; subdivision is raised as that needs. (Default: 1; random 4)

     * - to_world
       - |transform|
       - Rigid motion, with at most a uniform scale, applied to the deformed pad. (Default: none)

     * - (nested)
       - |bsdf|
       - What the pad is made of, usually a `region`. (Default: absorbing)

    Solves for the deformation (or looks it up: solutions are kept on disk) and becomes the mesh of the deformed
    surface, with the face attributes :monosp:`face_region` and :monosp:`face_cell`. Its bottom is glued to z = 0.

    A finish is laid on the undeformed cells and carried by the deformation. Layer steps are treads at the multiples of
    the layer height along the print direction, from the centre of the pad's bottom, and risers midway between; what
    lies along that direction stays, and a flat roof across it moves to the nearest level, by up to half a layer.
    Grooves are V-shaped, with ridges where the distance from that centre along groove_direction is a multiple of the
    pitch. Random heights are Gaussian, with the correlation exp(-r^2 / correlation_length^2). Both are measured along
    the normal of the smooth wall, and are 0 on average.

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
        self.finish = _read_finish(props)
        matrix = np.array(props.get("to_world", mi.ScalarTransform4f()).matrix, dtype=float)
        similarity_scale(matrix)
        if not any(isinstance(value, mi.BSDF) for _, value in props.objects()):
            props["bsdf"] = make_plugin("wall", scattering="absorbing")

        surface = self._solve()
        initialize_mesh(self, props, surface.vertices @ matrix[:3, :3].T + matrix[:3, 3], surface.triangles)
        add_face_attribute(self, "region", surface.region)
        add_face_attribute(self, "cell", surface.cell)

    def _solve(self):
        from mitsuba_taxel.mechanics import check_finish, load_path, tessellate

        with stages.stage("mechanics"):
            if self.finish is not None:
                # What cannot be made is refused before it is solved for.
                rest = load_path(self.pad, self.material, [(0, 0, 0)], mesh_size=self.mesh_size)[0]
                check_finish(self.finish, self.pad, rest.mesh, self.subdivision)
            self.state = load_path(self.pad, self.material, np.array([self.force]), mesh_size=self.mesh_size)[0]
            return tessellate(self.state, self.subdivision, self.finish)

    def to_string(self) -> str:
        return f"DeformablePad[cell = {self.pad.cell}, force = {self.force} N]"


def _read_pad(props: mi.Properties) -> Pad:
    lengths = {name: number(props, name, above=0) for name in _PAD_LENGTHS if name in props}
    counts = {name: whole_number(props, name, 3, minimum=1, maximum=100) for name in ("rows", "columns")}
    return Pad(cell=props.get("cell", Pad.cell), rows=counts["rows"], columns=counts["columns"], **lengths)


def _read_finish(props: mi.Properties):
    from mitsuba_taxel.mechanics import Grooves, LayerSteps, RandomRoughness

    name = choice(props, "finish", "smooth", ("smooth", "layer_steps", "grooves", "random"))
    if name == "smooth":
        return None
    default = RandomRoughness.refinement if name == "random" else LayerSteps.refinement
    refinement = number(props, "finish_refinement", default, above=0)
    if name == "layer_steps":
        direction = tuple(props.get("print_direction", mi.ScalarVector3f(0, 0, 1)))
        return LayerSteps(number(props, "layer_height", above=0), direction, refinement)
    if name == "grooves":
        direction = tuple(props.get("groove_direction", mi.ScalarVector3f(1, 0, 0)))
        pitch, depth = number(props, "groove_pitch", above=0), number(props, "groove_depth", above=0)
        return Grooves(pitch, depth, direction, refinement)
    rms, length = number(props, "rms_height", above=0), number(props, "correlation_length", above=0)
    seed = whole_number(props, "roughness_seed", 0, minimum=0, maximum=2**31 - 1)
    return RandomRoughness(rms, length, seed, refinement)
