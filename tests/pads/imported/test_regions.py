"""Which face is which region: guessed, and by rule; and how cells are numbered."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.geometry_error import GeometryError
from mitsuba_taxel.geometry.surfaces.triangles import area_normals
from mitsuba_taxel.pads import REGIONS
from mitsuba_taxel.pads.imported.regions import FacedSurface, tagged
from mitsuba_taxel.pads.imported.rules import Rule, read_rules
from mitsuba_taxel.pads.imported.triangles.repair import repaired
from mitsuba_taxel.pads.pad_file import PadFile
from mitsuba_taxel.scenes import hexagonal


def surface_of(corners: np.ndarray) -> FacedSurface:
    vertices, triangles = repaired(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    return FacedSurface(vertices, triangles, np.arange(len(triangles)))


def areas(surface: FacedSurface, rules=()) -> dict[str, float]:
    region, _ = tagged(surface, rules)
    size = np.linalg.norm(area_normals(surface.vertices, surface.triangles), axis=1)
    return {name: float(size[region == code].sum()) for name, code in REGIONS.items()}


def test_without_rules_a_hollow_has_roof_and_sides_and_the_rest_is_outer(box):
    expected = {"roof": 4.0, "side": 8.0, "bottom": 12.0, "top": 16.0, "outer": 48.0}
    assert areas(surface_of(box())) == pytest.approx(expected)


@pytest.mark.parametrize(("slope", "roof"), [(55, True), (65, False)])
def test_a_slope_is_roof_up_to_60_degrees(box, slope, roof):
    # The hollow is a pyramid without its tip, whose sides lean so far that their normals are ``slope`` off -z.
    corners = box(size=(8, 8, 6), hollow=(4, 4, 2))
    inside = np.all((corners == np.round(corners)) & (np.abs(corners) <= 2), axis=-1) & (corners[..., 2] == 2)
    corners[inside] *= (1 - 1 / np.tan(np.radians(slope)), 1 - 1 / np.tan(np.radians(slope)), 1)
    found = areas(surface_of(corners))
    assert (found["side"] == 0) is roof
    assert found["roof"] > 0


def turned(profile, segments, drawn=False) -> FacedSurface:
    """A round pad of radius 3 and height 4, its hollow of a profile of points (r, z) from the axis to the board; if
    ``drawn``, each turned line is a face, as of a STEP file."""
    outline = np.array([(0.0, 4.0), (3.0, 4.0), (3.0, 0.0), *profile[::-1]])
    angle = 2 * np.pi * np.arange(segments) / segments
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners, face = [], []
    for number, ((r, z), (s, y)) in enumerate(zip(outline[:-1], outline[1:], strict=True)):
        for here, there in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            a, b, c, d = (np.append(radius * way, up) for radius, up, way in
                          ((r, z, here), (s, y, here), (s, y, there), (r, z, there)))  # fmt: skip
            corners += [(a, b, c)] * int(s > 0) + [(a, c, d)] * int(r > 0)
            face += [number] * (int(s > 0) + int(r > 0))
    corners = np.array(corners)
    vertices, number = np.unique(np.round(corners.reshape(-1, 3), 9), axis=0, return_inverse=True)
    return FacedSurface(
        vertices, number.reshape(-1, 3), np.array(face) if drawn else np.arange(len(corners)), ["a"] if drawn else ()
    )


def dome(steps, radius=1.2, wall=0.5):
    angle = np.linspace(0, np.pi / 2, steps + 1)
    return [*zip(radius * np.sin(angle), wall + radius * np.cos(angle), strict=True), (radius, 0.0)]


def mantle(profile) -> float:
    """The area that a profile sweeps about the axis."""
    (r, z), (s, y) = np.array(profile[:-1]).T, np.array(profile[1:]).T
    return float((np.pi * (r + s) * np.hypot(r - s, z - y)).sum())


@pytest.mark.parametrize(("steps", "segments"), [(4, 12), (8, 24), (16, 64), (40, 200)])
def test_a_dome_of_triangles_is_one_roof_and_the_upright_wall_below_it_a_side(steps, segments):
    """Of a quarter of a circle of n steps about an axis; polygons in place of circles have less area by (pi/N)^2 / 3
    and more."""
    found, profile = areas(turned(dome(steps), segments)), dome(steps)
    less = 2 * (np.pi / segments) ** 2
    assert found["roof"] == pytest.approx(mantle(profile[:-1]), rel=less)
    assert found["side"] == pytest.approx(mantle(profile[-2:]), rel=less)


@pytest.mark.parametrize("drawn", [True, False])
@pytest.mark.parametrize("draft", [3.0, 10.0, 25.0])
def test_leaning_walls_of_a_mould_stay_sides(draft, drawn):
    """The mean normal of a cone looks straight down, however steep it is."""
    profile = [(0.0, 1.5), (1.0, 1.5), (1.0 + 1.5 * np.tan(np.radians(draft)), 0.0)]
    found = areas(turned(profile, 40, drawn))
    assert found["roof"] == pytest.approx(mantle(profile[:2]), rel=0.01)
    assert found["side"] == pytest.approx(mantle(profile[1:]), rel=0.01)


def test_the_first_rule_that_holds_wins(box):
    surface = surface_of(box())
    rules = [
        Rule("side", normal=(1, 0, 0), within=1, box=((-1.1, -2, 0), (-0.9, 2, 1))),
        Rule("outer", above=0.1, below=0.9, normal=(1, 0, 0)),
        Rule("roof", box=((-1.1, -1.1, 1.1), (1.1, 1.1, 0.1))),
    ]
    expected = {"roof": 10.0, "side": 2.0, "bottom": 12.0, "top": 16.0, "outer": 48.0}
    assert areas(surface, rules) == pytest.approx(expected)
    assert areas(surface, rules[2:]) == pytest.approx({**expected, "roof": 12.0, "side": 0.0})


def test_a_rule_for_the_top_leaves_no_other_one(box):
    found = areas(surface_of(box()), [Rule("top", normal=(0, 0, 1), box=((0, -2, 2), (2, 0, 4)))])
    assert found["top"] == pytest.approx(8.0)  # one of the two triangles
    assert found["outer"] == pytest.approx(56.0)


def test_the_rules_of_a_file_are_those_of_python(tmp_path):
    path = tmp_path / "regions.toml"
    path.write_text(
        """
        [[rule]]
        region = "roof"
        normal = [0, 0, -1]
        within = 80
        above = 0.5
        below = 3
        [[rule]]
        region = "top"
        face = "loaded"
        box = [[0, 0, 0], [1, -1, 5]]
        """
    )
    rules = read_rules(path)
    assert rules == (
        Rule("roof", normal=(0, 0, -1), within=80, above=0.5, below=3),
        Rule("top", face="loaded", box=((0, -1, 0), (1, 0, 5))),
    )
    (tmp_path / "a.stl").write_bytes(b"")
    assert PadFile(tmp_path / "a.stl", path) == PadFile(tmp_path / "a.stl", rules)
    assert hash(rules) == hash(read_rules(path))


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("[[rule]\n", "valid TOML: Expected"),
        ("rule = 3", r"allowed: .*\[\[rule\]\] tables"),
        ("rule = [3]", r"allowed: .*\[\[rule\]\] tables"),
        ("[[rules]]\nregion = 'roof'", r"allowed: .*\[\[rule\]\] tables"),
        ("[[rule]]\nabove = 3", "allowed: in rule 1, region is missing"),
        ("[[rule]]\nregion = 'roof'\nover = 3", "allowed: in rule 1, over is no condition"),
        ("[[rule]]\nregion = 'roof'\n[[rule]]\nregion = 'lid'", "allowed: in rule 2, region = 'lid'"),
    ],
)
def test_other_files_of_rules_are_refused(tmp_path, text, what):
    (tmp_path / "regions.toml").write_text(text)
    with pytest.raises(InputError, match=f"^regions = .* is not {what}") as caught:
        read_rules(tmp_path / "regions.toml")
    assert "\n" not in str(caught.value)


def test_a_file_of_rules_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="^regions = "):
        read_rules(tmp_path / "regions.toml")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("region", "lid"),
        ("face", 3),
        ("normal", (0, 0, 0)),
        ("normal", (1, 2)),
        ("normal", "up"),
        ("within", 0),
        ("within", 200),
        ("above", float("nan")),
        ("below", "high"),
        ("box", ((0, 0, 0), (1, 1))),
        ("box", 3),
    ],
)
def test_conditions_out_of_range_are_refused(name, value):
    with pytest.raises(InputError, match=f"^{name} = .* is not allowed"):
        Rule(**{"region": "roof", name: value})


def test_cells_are_numbered_row_by_row_from_minus_x_plus_y():
    rng = np.random.default_rng(5)
    corners = hexagonal.triangles()
    surface = surface_of(corners[rng.permutation(len(corners))])
    _, cell = tagged(surface, ())
    assert cell.max() == 7
    for number, centre in enumerate(hexagonal.centres(), start=1):
        corners = surface.vertices[surface.triangles[cell == number]].reshape(-1, 3)
        np.testing.assert_allclose(corners[:, :2].mean(axis=0), centre, atol=1e-6)


def lifted(corners):
    return corners + (0, 0, 0.01)


def slanted(corners):
    corners[:, :, 2] *= 1 + 0.05 * corners[:, :, 0]
    return corners


def without_hollow(corners):
    low = corners[:, :, 2] == 1
    corners[low] *= (1, 1, 0)
    return corners


@pytest.mark.parametrize(
    ("change", "rules", "what"),
    [
        (lifted, (), "no bottom: .* 0.01 to 3.01"),
        (slanted, (), "no top"),
        (without_hollow, (), "no cell"),
        (lambda c: c, [Rule("side", normal=(0, 0, -1), above=0.5)], r"cell at \(0, 0, 0.5\) mm has no roof"),
        (lambda c: c, [Rule("roof", face="dome")], "a rule names the face 'dome', which it does not have"),
        (lambda c: c, [Rule("outer")], "no bottom"),
    ],
)
def test_what_is_no_pad_is_refused(box, change, rules, what):
    with pytest.raises(GeometryError, match=what):
        tagged(surface_of(change(box())), rules)
