"""Pads with rounded mouths and rounded edges of the outside: closed forms, and meshes that follow their dimensions."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.element_maps import curved_volume, worst_element
from mitsuba_taxel.geometry.surfaces.triangles import area_normals
from mitsuba_taxel.mechanics.surface.tessellation import tessellate
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.parametric.drawings import solids
from mitsuba_taxel.pads.parametric.velocities import mesh_velocity
from mitsuba_taxel.pads.regions import REGIONS

HALF, HEIGHT = 1.275, 1.55
PADS = {
    "box": dict(cell="parallelepiped", fillet=0.3, mouth_fillet=0.2),
    "cylinder": dict(cell="cylindrical", mouth_fillet=0.1),
    "both": dict(cell="cylindrical", mouth_fillet=0.25, outer_fillet=0.15),
    "outside": dict(cell="cylindrical", outer_fillet=0.3),
}
MORE = PADS | {
    "dome": dict(cell="hemispheric", mouth_fillet=0.15),
    "cone": dict(cell="frustum", mouth_fillet=0.2, fillet=0.1),
}


def pad_of(name, **changes):
    return Pad(rows=1, columns=1, **MORE[name] | changes)


@pytest.fixture(scope="module")
def meshes():
    pads = {name: pad_of(name) for name in MORE}
    return {name: (pad, pad.mesh(1.25)) for name, pad in pads.items()}


def below_mouth(pad):
    """Volume and area of the air below the fillet of a mouth, by Pappus's theorems; the area is that of the arc."""
    m = pad.mouth_fillet
    section = (1 - math.pi / 4) * m**2
    centroid = (0.5 * m**3 - math.pi / 4 * m**2 * (m - 4 * m / (3 * math.pi))) / section if m else 0.0
    straight, turn = (8 * (HALF - pad.fillet), pad.fillet) if pad.cell == "parallelepiped" else (0.0, HALF)
    arc, arc_centroid = 0.5 * math.pi * m, m - 2 * m / math.pi
    volume = section * (straight + 2 * math.pi * (turn + centroid))
    return volume, arc * (straight + 2 * math.pi * (turn + arc_centroid))


def off_outside(pad):
    """Volume between the rounded edges of the outside and the sharp ones."""
    o, (x, y, z) = pad.outer_fillet, pad.extent
    section = (1 - math.pi / 4) * o**2
    return section * (4 * (z - o) + 2 * (x + y - 4 * o)) + 4 * (1 - math.pi / 6) * o**3


def lost(pad):
    return below_mouth(pad)[0] + off_outside(pad)


@pytest.mark.parametrize("name", PADS)
def test_volumes_and_areas_are_those_of_closed_forms(meshes, name):
    pad, mesh = meshes[name]
    sharp = solids(pad.with_blunt_edges(0.0, 0.0))["pad"].mass
    assert sharp - solids(pad)["pad"].mass == pytest.approx(lost(pad), rel=1e-7)
    assert curved_volume(mesh) == pytest.approx(solids(pad)["pad"].mass, abs=0.01 * lost(pad) + 1e-5 * sharp)
    state = type("Undeformed", (), {"mesh": mesh, "displacement": np.zeros_like(mesh.points)})()
    surface = tessellate(state, 12, pad=pad)
    areas = np.linalg.norm(area_normals(surface.vertices, surface.triangles), axis=1)
    x, y, o, m = *pad.extent[:2], pad.outer_fillet, pad.mouth_fillet
    area = {region: areas[surface.region == code].sum() for region, code in REGIONS.items()}
    assert area["top"] == pytest.approx((x - 2 * o) * (y - 2 * o), rel=1e-3)
    corner = 0.0 if name != "box" else (4 - math.pi) * (pad.fillet + m) ** 2
    mouth = 4 * (HALF + m) ** 2 - corner if name == "box" else math.pi * (HALF + m) ** 2
    assert area["bottom"] == pytest.approx(x * y - (4 - math.pi) * o**2 - mouth, rel=1e-3)
    if name != "box":
        side = 2 * math.pi * HALF * (HEIGHT - m) + below_mouth(pad)[1]
        assert area["side"] == pytest.approx(side, rel=1e-3)


def test_the_fillet_of_an_inclined_side_touches_side_and_board():
    """The cone's solid against a quadrature of its section, with the centre from the two tangents."""
    pad = pad_of("cone", fillet=0.0)
    m, slope = 0.2, (0.75 - HALF) / HEIGHT
    width = m * math.tan(0.5 * (math.pi - math.atan2(1.0, slope)))
    height = width / math.hypot(1.0, slope)

    def section(z):
        return math.pi * ((HALF + width - math.sqrt(m**2 - (m - z) ** 2)) ** 2 - (HALF + slope * z) ** 2)

    volumes = [solids(each)["pad"].mass for each in (replace(pad, mouth_fillet=0.0), pad)]
    assert volumes[0] - volumes[1] == pytest.approx(quad(section, 0.0, height)[0], rel=1e-6)


@pytest.mark.parametrize("name", MORE)
def test_nodes_lie_on_the_rounded_surfaces(meshes, name):
    pad, mesh = meshes[name]
    assert worst_element(mesh)[0] >= 0.2
    on = {region: np.unique(mesh.faces[mesh.face_region == code]) for region, code in REGIONS.items()}
    assert (mesh.points[on["bottom"], 2] == 0).all()
    if pad.mouth is not None:
        glued = mesh.points[np.intersect1d(on["side"], on["bottom"])]
        np.testing.assert_allclose(pad.mouth.coordinates(glued)[0], pad.mouth.width, atol=1e-9)
        d, z = pad.mouth.coordinates(mesh.points[on["side"]])[0], mesh.points[on["side"], 2]
        low = z < pad.mouth.height
        across = d[low] + pad.mouth.slope * z[low] - pad.mouth.width
        np.testing.assert_allclose(np.hypot(across, z[low] - pad.mouth_fillet), pad.mouth_fillet, atol=1e-9)
    if pad.outside is not None:
        core = np.clip(mesh.points[on["outer"]], *_core(pad))
        distance = np.linalg.norm(mesh.points[on["outer"]] - core, axis=1)
        np.testing.assert_allclose(distance, pad.outer_fillet, atol=1e-9)


def _core(pad):
    high = np.array(pad.extent) * [0.5, 0.5, 1.0] - pad.outer_fillet
    return [*-high[:2], -np.inf], high


@pytest.mark.parametrize(
    ("name", "dimension"), [("box", "mouth_fillet"), ("both", "mouth_fillet"), ("both", "outer_fillet")]
)
def test_the_volume_follows_the_radius(meshes, name, dimension):
    pad, mesh = meshes[name]
    velocity, step = mesh_velocity(pad, mesh, dimension), 1e-4
    moved = [curved_volume(replace(mesh, points=mesh.points + sign * step * velocity)) for sign in (1, -1)]
    radius = getattr(pad, dimension)
    exact = lost(replace(pad, **{dimension: radius - step})) - lost(replace(pad, **{dimension: radius + step}))
    assert moved[0] - moved[1] == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize(
    ("name", "dimension", "lean"),
    [
        ("box", "mouth_fillet", 0.0),
        ("box", "cell_size", 0.2),
        ("both", "outer_fillet", 0.2),
        ("both", "cell_height", 0.0),
        ("both", "wall", 0.0),
        ("dome", "cell_size", 0.0),
        ("cone", "mouth_fillet", 0.2),
        ("cone", "roof_size", 0.0),
    ],
)
def test_velocities_are_those_of_moved_meshes(name, dimension, lean):
    pad, change = pad_of(name, top_x=lean), 1e-5
    mesh = pad.mesh(2.0)
    moved = pad.changed(**{dimension: pad.dimensions[dimension] + change}).moved_from(pad).mesh(2.0)
    velocity = mesh_velocity(pad, mesh, dimension)
    # The second derivative of positions jumps by 1 / radius at the borders of fillets.
    np.testing.assert_allclose((moved.points - mesh.points) / change, velocity, atol=1e-5 / 0.1 + 1e-6)
    assert np.abs(velocity).max() > 0.1
    regions = np.unique(moved.faces[moved.face_region == REGIONS["bottom"]])
    assert (moved.points[regions, 2] == 0).all()


@pytest.mark.parametrize("name", ["box", "both", "cone"])
def test_the_mould_is_the_complement_of_the_pad(name):
    pad = pad_of(name)
    drawn = solids(pad)
    around = [side + 2 * 3.0 for side in pad.extent[:2]]
    base = 3.0 * math.prod(around) + math.prod(pad.extent) - off_outside(pad) - drawn["pad"].mass
    assert drawn["mould_base"].mass == pytest.approx(base, rel=1e-7)
    frame = (math.prod(around) - math.prod(pad.extent[:2])) * pad.height + off_outside(pad)
    assert drawn["mould_frame"].mass == pytest.approx(frame, rel=1e-9)


def test_the_gradient_of_the_projection_is_its_derivative():
    for name, heading in (("box", (1.3, 1.2)), ("box", (1.35, 0.2)), ("cylinder", (0.9, 0.95)), ("cone", (1.0, 0.9))):
        mouth = pad_of(name).mouth
        points, step = np.array([[*heading, 0.04], [-heading[0], heading[1], 0.02]]), 1e-6
        gradient = mouth.onto_arc(points)[1]
        for axis in range(3):
            move = step * np.eye(3)[axis]
            difference = (mouth.onto_arc(points + move)[0] - mouth.onto_arc(points - move)[0]) / (2 * step)
            np.testing.assert_allclose(gradient[:, :, axis], difference, atol=1e-7)


@pytest.mark.parametrize(
    ("dimensions", "words"),
    [
        (dict(cell="cylindrical", mouth_fillet=0.81), "mouth_fillet = 0.81 .* 0.0255 to 0.4 mm"),  # between neighbours
        (dict(cell="cylindrical", rows=1, columns=1, mouth_fillet=0.81), "0.0255 to 0.8 mm"),
        (dict(cell="hemispheric", cell_height=1.475, mouth_fillet=0.2), "to 0.16 mm"),  # higher than the side
        (dict(cell="cylindrical", mouth_fillet=1e-6), "mouth_fillet = 1e-06 is not allowed"),
        (dict(cell="parallelepiped", mouth_fillet=0.1), "mouth_fillet = 0.1 .* with fillet = 0"),
        (dict(cell="profile", profile="1 0.5; 0.5 1; 0 1", section="square", mouth_fillet=0.1), "square section"),
        (dict(cell="cylindrical", outer_fillet=0.9), "outer_fillet = 0.9 .* 0.0255 to 0.8 mm"),
        (dict(cell="cylindrical", outer_fillet=-0.1), "outer_fillet = -0.1 is not allowed"),
        (dict(cell="cylindrical", mouth_fillet=0.1, meshed_as="mouth_fillet=0"), "mouth_fillet = 0 is not allowed"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(dimensions, words):
    with pytest.raises(InputError, match=words) as error:
        Pad(**dimensions)
    assert "\n" not in str(error.value)
