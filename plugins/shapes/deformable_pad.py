"""The silicone pad with its cells, deformed by a force on its top."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import make_plugin
from mitsuba_taxel.base import stages
from mitsuba_taxel.kernels import pad_parameters
from mitsuba_taxel.kernels.cell_surface import CellSurface
from mitsuba_taxel.kernels.faces import similarity_scale
from mitsuba_taxel.kernels.mesh_adapter import Places, add_face_attribute, give_geometry, initialize_mesh
from mitsuba_taxel.kernels.pad_parameters import LEAST_FACES, check_triangles
from mitsuba_taxel.kernels.parameters import whole_number
from mitsuba_taxel.pads import REGIONS, Pad

SUBDIVISION = 6
"""Of the surface of a cell, where nobody asks for another."""
FLAT = 1e-5
"""Distance of triangles from a wall, relative to the pad's height, that is as good as none."""


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

     * - filename
       - |string|
       - A pad of one's own instead of those parameters: a closed surface as STL, PLY or OBJ, or a solid as STEP, in mm,
         standing on z = 0. (Default: none)

     * - regions
       - |string|
       - With filename: a TOML file of rules that say which face is which region. (Default: flat faces at the bottom
         and at the top, hollows, and the rest)

     * - material
       - |string|
       - A law, :monosp:`neo_hookean`, :monosp:`mooney_rivlin` or :monosp:`yeoh`; or a silicone of known stiffness:
         :monosp:`dragon_skin_10_medium`, :monosp:`dragon_skin_20`, :monosp:`dragon_skin_30`,
         :monosp:`ecoflex_00_30`, :monosp:`ecoflex_00_50`, :monosp:`mold_star_16_fast`, :monosp:`mold_star_20t`,
         :monosp:`rtv_615`, :monosp:`sorta_clear_40` or :monosp:`multiphysics_pad`. (Default: :monosp:`neo_hookean`)

     * - youngs_modulus
       - |float|
       - With :monosp:`neo_hookean`: Young's modulus at small strain, in MPa. (Default: 4.16)

     * - shore_a
       - |float|
       - With :monosp:`neo_hookean`, instead of a modulus: hardness Shore A. (Default: none)

     * - c10, c01, c20, c30
       - |float|
       - With :monosp:`mooney_rivlin` (c10, c01) and :monosp:`yeoh` (c10, c20, c30): constants in MPa. (Default: none;
         c20 and c30 0)

     * - poisson_ratio
       - |float|
       - Poisson's ratio, up to 0.5. (Default: 0.49, or that of the silicone)

     * - load
       - |string|
       - :monosp:`spread_force` on the whole top, :monosp:`patch_force` on a rectangle of it, :monosp:`plate_force` or
         :monosp:`plate_displacement` on a rigid plate that is bonded to the top and does not turn, or the
         :monosp:`pressure` of a fluid on top and outside. (Default: :monosp:`spread_force`)

     * - force
       - |vector|
       - Total force, in N; compression is negative along z. (Default: 0, 0, 0)

     * - displacement
       - |vector|
       - With :monosp:`plate_displacement`: of the plate, in mm. (Default: 0, 0, 0)

     * - pressure
       - |float|
       - With :monosp:`pressure`: in MPa. (Default: 0)

     * - patch_width, patch_depth
       - |float|
       - With :monosp:`patch_force`, which needs both: sides of the rectangle along x and y, in mm.

     * - patch_x, patch_y
       - |float|
       - With :monosp:`patch_force`: its centre, in mm. (Default: 0, 0)

     * - mesh_size
       - |float|
       - Size of the finite elements, in mm. (Default: 1.25 for cells and walls like the default ones; it goes with the
         scale of the pad, and with the square root of its thinnest part)

     * - mesh_tolerance
       - |float|
       - Instead of a size: relative error of the roofs' displacement under a small load that the size is chosen for.
         (Default: none)

     * - read_cells
       - |string|
       - Numbers of the cells that are read, as :monosp:`1, 5`; only their surface is cut finely. (Default:
         :monosp:`all`)

     * - subdivision
       - |int|
       - Triangles along the longest edge of a finite element on the surface of a cell; along others as many as keep
         theirs no longer. (Default: 6)

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
    surface, with the face attributes :monosp:`face_region` and :monosp:`face_cell`. Its bottom is glued to z = 0. A
    load beyond the first at which the pad touches itself, the board or a package, or is no longer stable, is refused.

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
        self.pad = pad_parameters.read_pad(props)
        self.material = pad_parameters.read_material(props)
        self.load, self.value = pad_parameters.read_load(props)
        self.mesh_size, self.mesh_tolerance = pad_parameters.read_mesh(props)
        self.read_cells = pad_parameters.read_cells(props)
        self.finish = pad_parameters.read_finish(props)
        self.to_world = np.array(props.get("to_world", mi.ScalarTransform4f()).matrix, dtype=float)
        similarity_scale(self.to_world)
        walls = [value for _, value in props.objects() if isinstance(value, mi.BSDF)]
        if not walls:
            props["bsdf"] = make_plugin("wall", scattering="absorbing")
        self.mirrors = [code for wall in walls for code in _mirrors(wall)]
        self.subdivision = whole_number(props, "subdivision", SUBDIVISION, minimum=1, maximum=64)

        self.surface = self._solve()
        triangles = self.surface.triangles
        places = self._places(self.surface, self.surface.facing)
        if places.normals is not None:
            triangles = np.arange(triangles.size).reshape(-1, 3)
        initialize_mesh(self, props, places, triangles)
        self._add_attributes(self)

    def _solve(self):
        from mitsuba_taxel.mechanics import check_finish

        with stages.stage("mechanics"):
            # What cannot be made is refused before it is solved for.
            if isinstance(self.pad, Pad):
                least = LEAST_FACES * len(self.read_cells or self.pad.cell_centres)
                check_triangles(self.subdivision, least)
            mesh = self.states([np.zeros(len(self.value))])[0].mesh
            read = np.isin(mesh.face_cell, self.read_cells) if self.read_cells else mesh.face_cell > 0
            check_triangles(self.subdivision, int(np.count_nonzero(read)))
            if self.finish is not None and isinstance(self.pad, Pad):
                check_finish(self.finish, self.pad, mesh, self.subdivision)
            self.state = self.states([self.value])[0]
            return self._tessellated(self.state)

    def _tessellated(self, state):
        from mitsuba_taxel.mechanics import tessellate

        return tessellate(state, self.subdivision, self.finish, self.read_cells, self.pad)

    def _places(self, surface, vertices) -> Places:
        """Where the mesh's vertices are; if there are mirrors, triangles share none, and those of mirrors have normals
        of the curved walls."""
        places = _placed(vertices, self.to_world)
        if not self.mirrors:
            return Places(places, None)
        corners = places[surface.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, None].repeat(3, axis=1)
        smooth = np.isin(surface.region, self.mirrors)
        normals[smooth] = np.einsum("tki,ji->tkj", surface.normals[smooth], self.to_world[:3, :3])
        normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), np.finfo(np.float32).tiny)
        return Places(corners.reshape(-1, 3), normals.reshape(-1, 3))

    @property
    def undeformed(self) -> CellSurface:
        """The same triangles without a load: one object for all pads of which it is the same."""
        cells = None if self.read_cells is None else tuple(self.read_cells)
        place = tuple(map(tuple, self.to_world.tolist()))
        return _undeformed(self.state.mesh, self.subdivision, self.finish, cells, self.pad, place)

    def deviating_places(self) -> list[Places] | None:
        """Where the vertices would be if the pad were off by each of its `State.deviations`; None if these are
        unknown."""
        if self.state.deviations is None:
            return None
        displaced = (self.state.displacement + deviation for deviation in self.state.deviations)
        surfaces = (self._tessellated(replace(self.state, displacement=u)) for u in displaced)
        return [self._places(surface, surface.facing) for surface in surfaces]

    @property
    def is_curved(self) -> bool:
        """Whether triangles are off curved walls by more than what changes readings by some 1e-5."""
        surface = self.surface
        return bool(np.abs(surface.offsets).max() > FLAT * np.ptp(surface.vertices[:, 2]))

    def chords(self) -> Places:
        """Where the vertices would be on the curved walls themselves, so that triangles are their chords."""
        return self._places(self.surface, self.surface.vertices)

    def closed(self) -> mi.Mesh:
        """The same surface as a mesh whose triangles share their vertices, whatever the walls."""
        if not self.mirrors:
            return self
        mesh = mi.Mesh(self.id(), len(self.surface.vertices), len(self.surface.triangles))
        give_geometry(mesh, Places(_placed(self.surface.facing, self.to_world), None), self.surface.triangles)
        self._add_attributes(mesh)
        return mesh

    def _add_attributes(self, mesh: mi.Mesh) -> None:
        add_face_attribute(mesh, "region", self.surface.region)
        add_face_attribute(mesh, "cell", self.surface.cell)

    def states(self, values, obstacles=None):
        """The deformed states of this pad under other values of its load; see `load_path`."""
        from mitsuba_taxel.mechanics import load_path

        return load_path(
            self.pad,
            self.material,
            values,
            load=self.load,
            mesh_size=self.mesh_size,
            mesh_tolerance=self.mesh_tolerance,
            obstacles=obstacles,
        )

    def to_string(self) -> str:
        return f"DeformablePad[{self.pad}, {self.load.quantity} = {self.value} {self.load.unit}]"


def _mirrors(bsdf: mi.BSDF) -> list[int]:
    """Codes of the regions whose wall sends some light, more or less, where a mirror would."""
    walls = getattr(bsdf, "walls", None) or dict.fromkeys(REGIONS, bsdf)
    directed = mi.BSDFFlags.Delta | mi.BSDFFlags.Glossy
    return [REGIONS[name] for name, wall in walls.items() if name in REGIONS and wall.flags() & directed]


@lru_cache(maxsize=4)  # the pads of a study share their mesh
def _undeformed(mesh, subdivision, finish, cells, pad, to_world):
    from mitsuba_taxel.mechanics import tessellate

    rest: Any = SimpleNamespace(mesh=mesh, displacement=np.zeros_like(mesh.points))  # all of a state that is looked at
    surface = tessellate(rest, subdivision, finish, cells, pad)
    vertices = _placed(surface.vertices, np.array(to_world))
    return CellSurface(vertices, surface.triangles, surface.region, surface.cell)


def _placed(vertices, to_world):
    # Not as a product of matrices: threads of its own, woken for so little, take several times as long on busy cores.
    return np.einsum("vi,ji->vj", vertices, to_world[:3, :3]) + to_world[:3, 3]
