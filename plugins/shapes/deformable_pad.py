"""A silicone pad with cells, deformed by a load."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import make_plugin, resolved_path
from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.kernels.dome_elements import edge_ratio, fewer_triangles, size_for_light
from mitsuba_taxel.kernels.pad_limits import (
    LEAST_FACES,
    check_mirrors,
    check_triangles,
    clear_regions,
    mirrors,
)
from mitsuba_taxel.kernels.protocols import AWAITED_PACKAGE, NO_ROOM, is_region
from mitsuba_taxel.kernels.surfaces.cell_surface import CellSurface
from mitsuba_taxel.kernels.surfaces.mesh_adapter import (
    Places,
    add_face_attribute,
    add_vertex_attribute,
    give_geometry,
    initialize_mesh,
    move_vertices,
)
from mitsuba_taxel.kernels.surfaces.regions import CONTACT
from mitsuba_taxel.pads import REGIONS, AnyPad, Block, Pad, PadFile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mitsuba_taxel.mechanics.continuation.state import State
    from mitsuba_taxel.mechanics.errors.second_state import SecondState
    from mitsuba_taxel.mechanics.surface.tessellation import Surface
    from mitsuba_taxel.pads.markers import Markers

MARKER_REFLECTANCE = 0.03
"""Reflectance of markers, as of black ink."""
FLAT = 1e-5
"""Negligible distance of triangles from a curved wall, relative to the height of the pad."""


class DeformablePad(mi.Mesh):
    r"""
    .. _shape-deformable_pad:

    Deformable pad (:monosp:`deformable_pad`)
    -----------------------------------------

    This shape computes the deformation of the pad by finite elements (solutions are cached on disk). It is the mesh of
    the deformed surface, with the face attributes :monosp:`face_region` and :monosp:`face_cell`. The bottom of the pad
    is fixed at z = 0. A load is refused if the pad becomes unstable before it is reached. It is also refused if the pad
    touches itself, the board or a package before it is reached, unless :monosp:`self_contact` is true.

    The roof of a cell with a profile is a surface of revolution. Its meridian is a clamped B-spline in r^2 and z with
    evenly spaced knots, of degree 3 or of one less than its number of points. The roof is therefore smooth on the axis,
    and flat, spherical and hemispheric roofs are exactly representable (:monosp:`Pad.as_profile` in Python gives their
    points). The side below the roof is straight. A frustum is a cone with a flat roof of the diameter
    :monosp:`roof_size`.

    With :monosp:`cell = none` the pad is a block without cells, of :monosp:`width` x :monosp:`depth` x
    :monosp:`height`, for sensors with a camera. Its bottom is glued to a clear plate, through which the camera looks
    into the pad. Its top, plane or part of a sphere, has the opaque coat that the camera sees from inside. Regions are
    :monosp:`bottom`, :monosp:`top` and :monosp:`outer`.

    A finish is applied to the undeformed cells and moves with the deformation. Layer steps are treads at multiples of
    the layer height along the print direction, measured from the layer offset, with risers midway between them. The
    offset is measured from the centre of the pad's bottom, at the height of the cells' mouths. Walls along that
    direction are unchanged; a flat roof across it moves to the nearest level, by up to half a layer. Grooves are
    V-shaped, with ridges where the distance from that centre along groove_direction is a multiple of the pitch.
    Random heights are Gaussian, with the correlation exp(-r^2 / correlation_length^2). Heights of grooves and random
    finishes are measured along the normal of the smooth wall, and are 0 on average.

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
        from mitsuba_taxel.mechanics.history.timed_rows import rubs
        from mitsuba_taxel.specification.deformable_pad import DeformablePad as Parameters

        # Parameters and the objects that they describe.
        packages_follow = AWAITED_PACKAGE in props and isinstance(props[AWAITED_PACKAGE], mi.Properties)
        if packages_follow:
            del props[AWAITED_PACKAGE]
        self.specification = parameters = Parameters.read(props)
        self.pad = parameters.build_pad(resolved_path)
        self.material = parameters.build_material()
        self.load, self.value = parameters.build_load(resolved_path)
        self.prony, self.history = parameters.build_prony(), parameters.build_history()
        self.mullins = parameters.build_mullins()
        self.remembers = bool(self.prony) or self.mullins is not None or rubs(self.load)
        self.mesh_size, self.mesh_tolerance, self.judged_on = parameters.mesh_size, parameters.mesh_tolerance, None
        self.read_cells = parameters.cell_numbers()
        self.finish = parameters.build_finish()
        self.subdivision = parameters.subdivision
        self.to_world = np.eye(4) if parameters.to_world is None else np.array(parameters.to_world.matrix, dtype=float)

        # A BSDF for each region: where the pad touches a package, light is blocked by a region of its own.
        walls = [value for _, value in props.objects() if isinstance(value, mi.BSDF)]
        if not walls:
            props["bsdf"] = make_plugin("wall", scattering="absorbing")
        elif self.load.self_contact and not is_region(walls[0]):
            name = next(name for name, value in props.objects() if value is walls[0])
            props[name] = make_plugin("region", **dict.fromkeys(REGIONS, walls[0]))
        # Light passes through a null wall of a block, but rays to a light would end there: it gets no triangles.
        is_coated = isinstance(self.pad, Block) or self._is_file_without_cells()
        if not is_coated and any(is_region(wall) and wall.without_cells for wall in walls):
            raise InputError(
                f"coat and window are not allowed for a pad with cells: its regions are {', '.join(REGIONS)}."
            )
        self.clear = clear_regions(walls) if is_coated else []
        self.mirrors = [code for wall in walls for code in mirrors(wall) if code not in self.clear]
        if isinstance(self.pad, Block) and (markers := parameters.build_markers()):
            painted = _painted(markers, self.pad, walls)
            name = next(name for name, value in props.objects() if value is walls[0])
            props[name] = walls[0] = painted
        # A camera sees single triangles of the coat, which would look like facets.
        self.smooth = sorted({*self.mirrors, REGIONS["top"]}) if is_coated else self.mirrors
        check_mirrors(self.pad, self.mirrors, self.subdivision)

        # Elements and triangles of loaded cells are chosen by the light unless a mesh size is set.
        if self.is_loaded and not (self.remembers or self.mesh_size or self.mesh_tolerance):
            self.mesh_size = size_for_light(self.pad, self.load, walls)
            if self.mesh_size is not None:
                assert isinstance(self.pad, Pad)  # of pads from files, none is chosen
                self.judged_on = self.pad.default_mesh_size
                self.subdivision = fewer_triangles(self.subdivision, self.pad, self.mesh_size)

        # The deformed surface becomes the mesh. A state is tested once against the same obstacles.
        self._heeded: tuple[State, bytes] | None = None
        self.surface = self._solve(waits=packages_follow and self.load.self_contact)
        triangles = self.surface.triangles
        mesh_data = self._places(self.surface, self.surface.facing)
        if mesh_data.normals is not None:
            triangles = np.arange(triangles.size).reshape(-1, 3)
        initialize_mesh(self, props, mesh_data, triangles, self._texcoords())
        self._add_attributes(self)

    def _is_file_without_cells(self) -> bool:
        """Whether the pad is from a file and has no cells."""
        if not isinstance(self.pad, PadFile):
            return False
        with stages.stage("mechanics"):
            return not self.at_rest().mesh.face_cell.any()

    def _solve(self, waits: bool) -> Surface:
        """The surface of the pad under its load; the undeformed surface if it ``waits`` for packages."""
        from mitsuba_taxel.mechanics import check_finish
        from mitsuba_taxel.mechanics.cutting import in_cells

        with stages.stage("mechanics"):
            # Limits on triangles and finishes are checked before the solve. Smaller elements do not change the number
            # of triangles, but are generated later.
            subdivision = self.specification.subdivision
            if isinstance(self.pad, Pad):
                least = LEAST_FACES * len(self.read_cells or self.pad.cell_centres)
                check_triangles(subdivision, least)
            mesh = self.at_rest(self.judged_on).mesh
            check_triangles(subdivision, int(np.count_nonzero(in_cells(mesh, self.read_cells))))
            if self.finish is not None and isinstance(self.pad, Pad):
                check_finish(self.finish, self.pad, mesh, subdivision)
            try:
                self.state = self.at_rest() if waits else self.state_under(self.value)
            except ComputationError as error:
                str(error)  # the message may take a solution, and Mitsuba would swallow an interrupt of it
                raise
            return self._tessellated(self.state, self.pad)

    def _tessellated(self, state: State, pad: AnyPad, finish: Any = None) -> Surface:
        """Triangulated surface of a state of the pad, with its finish or another one."""
        from mitsuba_taxel.mechanics import tessellate

        cut_of = None if state.mesh is self.state.mesh else self.state.mesh
        surface = tessellate(state, self.subdivision, finish or self.finish, self.read_cells, pad, cut_of)
        if not self.clear:
            return surface
        kept = ~np.isin(surface.region, self.clear)
        by_triangle = {name: getattr(surface, name)[kept] for name in ("triangles", "region", "cell", "normals")}
        return replace(surface, **by_triangle)

    def _places(self, surface: Surface, vertices: np.ndarray) -> Places:
        """Vertices and normals of the mesh.

        With mirrors or a coat, triangles do not share vertices, and those of mirrors and coat have the normals of the
        curved walls.
        """
        positions, region = _placed(vertices, self.to_world), self.changing_region(surface)
        if not self.smooth:
            return Places(positions, None, region)
        corners = positions[surface.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, None].repeat(3, axis=1)
        smooth = np.isin(surface.region, self.smooth)
        normals[smooth] = np.einsum("tki,ji->tkj", surface.normals[smooth], self.to_world[:3, :3])
        normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), np.finfo(np.float32).tiny)
        return Places(corners.reshape(-1, 3), normals.reshape(-1, 3), region)

    def _texcoords(self) -> np.ndarray | None:
        """Texture coordinates of the vertices of a block, which do not depend on its load: x and y of the unloaded
        pad, from 0 to 1 along its sides; None for other pads."""
        if not isinstance(self.pad, Block):
            return None
        pose = tuple(map(tuple, np.eye(4).tolist()))
        rest = _undeformed(self.state.mesh, self.subdivision, self.finish, None, self.pad, pose)
        return 0.5 + rest.vertices[self.surface.triangles].reshape(-1, 3)[:, :2] / self.pad.extent[:2]

    def changing_region(self, surface: Surface | None = None) -> np.ndarray | None:
        """Region codes (T,) of a surface that may touch packages, by default the current surface; None if regions
        cannot change."""
        surface = surface or self.surface
        return None if self.state.bodies is None else np.where(surface.shut, CONTACT, surface.region)

    @property
    def undeformed(self) -> CellSurface:
        """The surface without a load, with the same triangles; equal surfaces of several pads are a single object."""
        cells = None if self.read_cells is None else tuple(self.read_cells)
        pose = tuple(map(tuple, self.to_world.tolist()))
        return _undeformed(self.state.mesh, self.subdivision, self.finish, cells, self.pad, pose)

    def deviating_places(self, fraction: float = 1.0) -> list[Places] | None:
        """Vertices displaced by a fraction of each of `State.deviations`, the estimated errors; None if unknown.

        For pads with mirrors, a further item has the walls in place and only their curvature changed by its error.
        """
        if self.state.deviations is None:
            return None
        displaced = (self.state.displacement + fraction * deviation for deviation in self.state.deviations)
        surfaces = (self._tessellated(replace(self.state, displacement=u), self.pad) for u in displaced)
        deviating = [self._kept_in_contact(surface) for surface in surfaces]
        if self.mirrors:
            bend = fraction / ERROR_SHARE * self.curvature_errors(self.state.displacement)
            deviating.append(self._bent(self.surface, self.surface.facing, bend))
        return deviating

    def curvature_errors(self, displacement: np.ndarray) -> np.ndarray:
        """Typical errors of the curvature of walls, as `bent_normals` takes them, under a displacement (N, 3) in mm."""
        from mitsuba_taxel.mechanics import chosen_size, curvature_errors

        size = chosen_size(self.pad, self.material, self.load, self.loaded_mesh_size, self.mesh_tolerance)
        return curvature_errors(self.state.mesh, displacement, edge_ratio(self.pad, size), self.pad.default_mesh_size)

    def _bent(self, surface: Surface, vertices: np.ndarray, curvature: np.ndarray) -> Places:
        """Vertices of the mesh, and normals for which the curvature of walls is changed by ``curvature`` in 1/mm."""
        from mitsuba_taxel.mechanics import bent_normals

        return self._places(replace(surface, normals=bent_normals(surface, curvature)), vertices)

    def _kept_in_contact(self, surface: Surface) -> Places:
        """Vertices of a surface that is displaced by an error; vertices in contact with a package stay in place."""
        touches = self.surface.touches
        if not touches.any():
            return self._places(surface, surface.facing)
        surface = replace(surface, touches=surface.touches | touches)
        return self._places(surface, np.where(touches[:, None], self.surface.facing, surface.facing))

    def moved_places(
        self, state: State, pad: AnyPad, chords: bool = False, curvature: np.ndarray | None = None
    ) -> Places:
        """Vertices of a state with slightly changed displacement or nodes, and of a pad with changed dimensions.

        Parameters
        ----------
        state : State
            The changed state.
        pad : AnyPad
            The pad of that state.
        chords : bool
            Whether vertices lie on the curved walls, so that triangles are chords.
        curvature : ndarray, optional
            Change of the curvature of the walls as mirrors see it, as `bent_normals` takes it.

        Returns
        -------
        Places
            Vertices and normals.
        """
        surface = self._tessellated(state, pad)
        vertices = surface.vertices if chords else surface.facing
        return self._places(surface, vertices) if curvature is None else self._bent(surface, vertices, curvature)

    @property
    def is_curved(self) -> bool:
        """Whether the deviation of flat triangles from curved walls changes readings by more than about 1e-5,
        relatively.
        """
        surface = self.surface
        return bool(np.abs(surface.offsets).max() > FLAT * np.ptp(surface.vertices[:, 2]))

    def chords(self) -> Places:
        """Vertices that lie on the curved walls, so that triangles are inscribed in the walls (chords)."""
        return self._places(self.surface, self.surface.vertices)

    def blunt_heights(self) -> Places | None:
        """Vertices of a random finish whose slopes are reduced, by a multiple of the loss due to triangles.

        None without a random finish.
        """
        if self.finish is None:
            return None
        from mitsuba_taxel.mechanics.surface.wall_finishes import with_blunt_heights

        blunt = with_blunt_heights(self.finish)
        return None if blunt is None else self._kept_in_contact(self._tessellated(self.state, self.pad, blunt))

    def closed(self) -> mi.Mesh:
        """The surface as a closed mesh whose triangles share vertices; for mirrors and coats, the surface in use may
        have separate vertices.
        """
        if not self.smooth:
            return self
        mesh = mi.Mesh(self.id(), len(self.surface.vertices), len(self.surface.triangles))
        give_geometry(mesh, Places(_placed(self.surface.facing, self.to_world), None), self.surface.triangles)
        self._add_attributes(mesh)
        return mesh

    def _add_attributes(self, mesh: mi.Mesh) -> None:
        region = self.changing_region()
        add_face_attribute(mesh, "region", self.surface.region if region is None else region)
        add_face_attribute(mesh, "cell", self.surface.cell)
        if self.contact_pressure is not None and mesh.vertex_count() == len(self.contact_pressure):
            add_vertex_attribute(mesh, "contact_pressure", self.contact_pressure)

    @cached_property
    def contact_pressure(self) -> np.ndarray | None:
        """Contact pressure (V,) of an indenter at the vertices of the surface in MPa; None without an indenter."""
        from mitsuba_taxel.mechanics import contact_pressure_at_vertices

        if self.state.indenter_moved is None:
            return None
        return contact_pressure_at_vertices(self.state, self.subdivision, self.finish, self.read_cells, self.pad)

    @property
    def is_loaded(self) -> bool:
        """Whether the pad is displaced by its load or by an earlier load."""
        return any(self.value) or (self.remembers and any(map(any, self.history[1])))

    def at_rest(self, mesh_size: float | None = None) -> State:
        """The unloaded state, on the elements of the loaded state or on elements of another size in mm."""
        return self._at_rest(self._settings if mesh_size is None else self._settings | {"mesh_size": mesh_size})

    def at_onset(self) -> State:
        """The unloaded state on the finite elements that loaded states have, for derivatives with respect to a load."""
        settings = self._loaded_settings
        return self._at_rest({name: settings[name] for name in self._settings})

    def _at_rest(self, settings: dict[str, Any]) -> State:
        from mitsuba_taxel.mechanics import state_at_rest

        values = self.history[1] if self.remembers else [self.value]
        return state_at_rest(self.pad, self.material, values, **settings)

    def state_under(self, value: Sequence[float], obstacles: np.ndarray | None = None) -> State:
        """The state under another final value of the load.

        Parameters
        ----------
        value : sequence of float
            Components of the load.
        obstacles : (K, 3, 3) ndarray, optional
            Corners of triangles in the frame of the pad, mm.

        Returns
        -------
        State
            Last state of the path; see `load_path`.
        """
        from mitsuba_taxel.mechanics import Viscoelastic, load_path, state_after

        if not (self.remembers and self.is_loaded):
            settings = self._settings | {"judged_on": self.judged_on}
            return load_path(self.pad, self.material, [value], obstacles=obstacles, **settings)[0]
        times, values = self.history
        path = [*values[:-1], value]
        if not self.prony:
            elastic = self.mullins or self.material
            return state_after(self.pad, elastic, path, None, obstacles=obstacles, **self._settings)
        material = Viscoelastic(self.material, self.prony)
        return state_after(self.pad, material, path, times, obstacles=obstacles, **self._settings)

    def heed(self, obstacles: np.ndarray) -> bool:
        """Deform the pad in contact with obstacles, such as packages. Returns whether vertices were moved.

        Parameters
        ----------
        obstacles : (K, 3, 3) ndarray
            Corners of triangles in the frame of the pad, mm.

        Returns
        -------
        bool
            Whether vertices were moved, which requires ``self_contact``.

        Raises
        ------
        InputError, ComputationError
            for the reasons of `load_path`: if the undeformed pad touches an obstacle, or if the load path ends.
        """
        if not self.state.mesh.face_cell.any():
            raise InputError(f"{NO_ROOM}: a pad with cells is needed.")
        corners = obstacles.tobytes()
        if self._heeded is not None and self._heeded[0] is self.state and self._heeded[1] == corners:
            return False
        try:
            state = self.state_under(self.value, obstacles)
        except InputError as error:
            # The undeformed pad touches an obstacle: the message gets advice on where there is room.
            if isinstance(self.pad, PadFile):
                from mitsuba_taxel.pads.imported.regions import extents_of

                mesh = self.state.mesh
                advice = self.pad.placement.advice(*extents_of(mesh.points[mesh.faces], mesh.face_cell))
            else:
                advice = self._room_needed(obstacles)
            raise InputError(f"{str(error).removesuffix('.')}; {advice}.") from error
        if not self.load.self_contact:
            self._heeded = self.state, corners
            return False
        before, self.state = self.state, state
        self._heeded = self.state, corners
        if np.array_equal(before.displacement, state.displacement):
            return False
        self.take(state)
        return True

    def _room_needed(self, obstacles: np.ndarray) -> str:
        """Text with the width that cells need for the first package that does not fit into its cell; with the actual
        width of the cells if all packages fit."""
        from mitsuba_taxel.mechanics.contact.barriers.bodies import body_of_each
        from mitsuba_taxel.pads.room import holds, nearest_cell, room_needed

        assert isinstance(self.pad, Pad)  # the advice for pads from files is another
        body = body_of_each(obstacles)
        for corners in (obstacles[body == index].reshape(-1, 3) for index in range(body.max() + 1)):
            middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
            centre = self.pad.cell_centres[nearest_cell(self.pad, middle[None, :2])[0]]
            if not holds(self.pad, (corners - [*centre, 0.0])[None])[0]:
                return room_needed(self.pad, corners)
        return f"its cells are {self.pad.cell_size:g} mm wide"

    def take(self, state: State) -> None:
        """Move the vertices to the surface of another state of the pad on the same mesh."""
        self.state, self.surface = state, self._tessellated(state, self.pad)
        move_vertices(self, self._places(self.surface, self.surface.facing))

    def second_state(self) -> SecondState | None:
        """The state on elements of another size, for the error of derivatives; see `second_state`."""
        from mitsuba_taxel.mechanics import second_state

        return second_state(self.pad, self.material, self.value, bodies=self.state.bodies, **self._loaded_settings)

    @property
    def _settings(self) -> dict[str, Any]:
        """Arguments of `load_path`: the load and its mesh."""
        return {"load": self.load, "mesh_size": self.mesh_size, "mesh_tolerance": self.mesh_tolerance}

    @property
    def loaded_mesh_size(self) -> float | None:
        """Size in mm of the elements of the loaded pad, which may be smaller than at rest."""
        if self.is_loaded or self.remembers or self.mesh_size or self.mesh_tolerance:
            return self.mesh_size
        return size_for_light(self.pad, self.load, [self.bsdf()])

    @property
    def _loaded_settings(self) -> dict[str, Any]:
        """Arguments of `load_path` on the elements of the loaded pad."""
        mesh_size, judged_on = self.loaded_mesh_size, self.judged_on
        if mesh_size != self.mesh_size:
            judged_on = self.pad.default_mesh_size
        return self._settings | {"mesh_size": mesh_size, "judged_on": judged_on}

    def to_string(self) -> str:
        return f"DeformablePad[{self.pad}, {self.load.quantity} = {self.value} {self.load.unit}]"


def _painted(markers: Markers, block: Block, walls: list[mi.BSDF]) -> mi.BSDF:
    """New region BSDF of a block with markers on its coat. The given BSDF is unchanged, as pads may share it."""
    if not (walls and is_region(walls[0]) and "top" in walls[0].walls):
        raise InputError("markers are not allowed without a coat: a region BSDF with a coat is needed.")
    weight = {"type": "bitmap", "bitmap": mi.Bitmap(markers.map_on(block)[..., None]), "raw": True}
    dark = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": MARKER_REFLECTANCE}}
    parts = {"weight": weight | {"wrap_mode": "clamp"}, "coat": walls[0].walls["top"], "markers": dark}
    return make_plugin("region", **{**walls[0].walls, "top": mi.load_dict({"type": "blendbsdf", **parts})})


@kept(4)  # the pads of a study share their mesh
def _undeformed(mesh, subdivision, finish, cells, pad, to_world):
    """The undeformed surface in world coordinates."""
    from mitsuba_taxel.mechanics import tessellate

    # Tessellation uses only these two attributes of a state.
    rest: Any = SimpleNamespace(mesh=mesh, displacement=np.zeros_like(mesh.points))
    surface = tessellate(rest, subdivision, finish, cells, pad)
    vertices = _placed(surface.vertices, np.array(to_world))
    return CellSurface(vertices, surface.triangles, surface.region, surface.cell)


def _placed(vertices: np.ndarray, to_world: np.ndarray) -> np.ndarray:
    """Vertices (V, 3) transformed into world coordinates."""
    # A matrix product would start BLAS threads, which takes several times as long on busy cores.
    return np.einsum("vi,ji->vj", vertices, to_world[:3, :3]) + to_world[:3, 3]
