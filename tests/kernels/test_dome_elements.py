"""Loaded cells have elements as small as their light needs."""

from __future__ import annotations

import pytest

from mitsuba_taxel.backend.plugin_objects import make_plugin
from mitsuba_taxel.kernels.dome_elements import MOST_CELLS, fewer_triangles, size_for_light
from mitsuba_taxel.mechanics import Indenter, IndenterForce, SpreadForce
from mitsuba_taxel.pads import Pad

pytestmark = pytest.mark.usefixtures("llvm_mono")
DOME = Pad("hemispheric", rows=1, columns=1)


@pytest.mark.parametrize(
    ("scattering", "share", "of_spheres"),
    [("mirror", 0.5, 0.6), ("rough_mirror", 0.5, 0.6), ("isotropic", 0.6, 0.5), ("absorbing", None, None)],
)
def test_the_size_follows_the_light(scattering, share, of_spheres):
    more = {"rms_slope": 2.0} if scattering == "rough_mirror" else {}
    walls = [make_plugin("wall", scattering=scattering, **more)]
    for pad, wanted in ((DOME, share), (DOME.as_profile(), share and 0.5), (Pad("spherical"), of_spheres)):
        size = size_for_light(pad, SpreadForce(), walls)
        assert size == (None if wanted is None else wanted * pad.default_mesh_size)
    several = size_for_light(Pad("hemispheric"), SpreadForce(), walls)
    assert several == (share and {0.5: 0.55}.get(share, share) * DOME.default_mesh_size)
    for flat in (Pad("cylindrical"), Pad("parallelepiped", rows=1, columns=1), Pad("frustum", rows=1, columns=1)):
        relative = 0.5 if len(flat.cell_centres) == 1 else 0.6
        expected = relative * flat.default_mesh_size if share == 0.5 else None  # mirrors alone
        assert size_for_light(flat, SpreadForce(), walls) == expected


def test_indented_and_large_pads_keep_the_default():
    walls = [make_plugin("wall", scattering="mirror")]
    large = Pad("spherical", rows=1, columns=MOST_CELLS + 1)
    assert size_for_light(large, SpreadForce(), walls) is None
    assert size_for_light(DOME, IndenterForce(Indenter("sphere", radius=2.0)), walls) is None


def test_triangles_do_not_become_smaller_with_the_elements(llvm_mono):
    """Of a loaded dome, beside those of the elements of the pad's own size."""
    pad = {"type": "deformable_pad", "rows": 1, "columns": 1, "cell": "hemispheric", "force": [0, 0, -0.1]}
    pad["walls"] = {"type": "wall", "scattering": "mirror"}
    finer, same = (llvm_mono.load_dict(pad | more) for more in ({}, {"mesh_size": DOME.default_mesh_size}))
    assert len(finer.state.mesh.tets) > 3 * len(same.state.mesh.tets)
    assert finer.face_count() < 3 * same.face_count()  # not 16 times


def test_edges_of_smaller_elements_keep_their_triangles():
    """Edges on domes fall with the square of the size of elements, those on flat walls with the size."""
    assert fewer_triangles(12, DOME, 0.5 * DOME.default_mesh_size) == 3
    flat = Pad("cylindrical")
    assert fewer_triangles(12, flat, 0.5 * flat.default_mesh_size) == 6
