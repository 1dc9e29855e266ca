"""Each property and nested object that Mitsuba's own classes would take is followed, or refused in one line."""

from __future__ import annotations

import numpy as np
import pytest
from plate_scenes import ABSORBING, rectangles

from mitsuba_taxel import InputError, Scene, measure

FILM = {"type": "hdrfilm", "width": 2, "height": 2, "pixel_format": "luminance", "rfilter": {"type": "box"}}
OF_PLUGINS = {
    "pad": {"flip_normals": True, "face_normals": True, "silhouette_sampling_weight": 0.5},
    "reflector": {"flip_normals": True, "face_normals": True, "silhouette_sampling_weight": 0.5},
    "reflector.led": {"sampling_weight": 0.5, "to_world": "shift"},
    "reflector.sensor": {"to_world": "shift", "shutter_open": 1.0, "shutter_close": 1.0, "near_clip": 0.1},
    "reflector.cover": {"opacity": 0.5},
    "reflector.sensor.sampler": {"jitter": False},
    "integrator": {"hide_emitters": True, "timeout": 1.0, "samples_per_pass": 1, "block_size": 8},
}
"""Properties that Mitsuba's base classes know, or nobody does, by the part that they are given to."""
OBJECTS = {
    "film": FILM,
    "sampler": {"type": "owen_sobol"},
    "texture": {"type": "uniform", "value": 0.5},
    "bsdf": {"type": "diffuse"},
    "shape": {"type": "sphere"},
    "emitter": {"type": "area"},
    "sensor": {"type": "irradiancemeter", "film": FILM},
    "rfilter": {"type": "box"},
    "medium": {"type": "homogeneous"},
}
TAKEN = {
    "pad": ("bsdf",),
    "reflector": ("emitter", "sensor", "bsdf"),
    "reflector.sensor": ("film", "sampler"),
    "board": ("bsdf", "emitter", "sensor", "texture"),
}
"""Objects that parts have a use for."""


def whole_scene() -> dict:
    """A pad over a photo-reflector on a board."""
    cover = {"type": "wall", "scattering": "absorbing"}
    sensor = {"type": "phototransistor", "sampler": {"type": "owen_sobol"}}
    return {
        "type": "scene",
        "integrator": {"type": "taxel_tracer"},
        "pad": {"type": "deformable_pad", "rows": 1, "columns": 1, "mesh_size": 2.5},
        "reflector": {"type": "photo_reflector", "led": {"type": "annular_led"}, "sensor": sensor, "cover": cover},
        "board": {"type": "rectangle"},
    }


def given(scene: dict, part: str, name: str, value) -> Scene:
    """The scene with a further property of one of its parts."""
    place = scene
    for word in part.split("."):
        place = place[word]
    place[name] = value
    return Scene(scene)


@pytest.mark.parametrize("part, name", [(part, name) for part, names in OF_PLUGINS.items() for name in names])
def test_values_that_only_mitsubas_base_classes_know_are_refused(llvm_mono, part, name):
    value = OF_PLUGINS[part][name]
    value = llvm_mono.ScalarTransform4f().translate([0, 0, 1]) if value == "shift" else value
    with pytest.raises(InputError, match=rf"^{name} is no parameter of \w+\.$"):
        given(whole_scene(), part, name, value).load()


@pytest.mark.parametrize(
    "part, kind",
    [(part, kind) for part in (*OF_PLUGINS, "board") for kind in OBJECTS if kind not in TAKEN.get(part, ())],
)
def test_objects_that_nothing_reads_are_refused(llvm_mono, part, kind):
    """Before, a sphere in a rectangle, or a film in a pad, was lost without a word."""
    light = part in ("reflector.led", "reflector.sensor") and kind == "medium"
    words = "participating medium" if light else "has no (use for|effect unless)|no parameter of"
    with pytest.raises(InputError, match=words) as caught:
        measure(given(whole_scene(), part, "further", OBJECTS[kind]), points=16)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("integrator", ["taxel_tracer", "path"])
@pytest.mark.parametrize("part", ["led", "detector", "plate"])
def test_flipped_normals_are_followed(llvm_mono, agree, part, integrator):
    """An LED or phototransistor that looks the other way sees nothing; flipped and turned over, it is as before."""
    mi = llvm_mono

    def read(seed, **changes):
        scene = rectangles().source
        scene["integrator"] = {"type": integrator}
        scene[part].update(changes)
        return measure(Scene(scene), points=1024, seed=seed)

    turned = rectangles().source[part]["to_world"] @ mi.ScalarTransform4f().rotate([1, 0, 0], 180)
    mirrored = rectangles().source[part]["to_world"] @ mi.ScalarTransform4f().scale([1, 1, -1])
    plain = read(1)
    for seed, place in ((2, turned), (3, mirrored)):
        back = read(seed, to_world=place, flip_normals=True)
        agree(back.power, back.standard_error, plain.power, plain.standard_error)
    away = read(4, flip_normals=True)
    if part == "plate":  # a wall has two sides
        agree(away.power, away.standard_error, plain.power, plain.standard_error)
    else:
        assert np.array_equal(away.power, [0.0])


@pytest.mark.parametrize("name, value", [("face_normals", True), ("silhouette_sampling_weight", 0.5)])
@pytest.mark.parametrize("part", ["led", "detector", "plate"])
def test_what_changes_no_light_is_taken(llvm_mono, part, name, value):
    """Rectangles are flat, and silhouettes are sampled for derivatives of Mitsuba's own only."""
    scene = rectangles().source
    before = measure(Scene(scene), points=64, seed=1)
    scene[part][name] = value
    assert np.array_equal(measure(Scene(scene), points=64, seed=1).replicates, before.replicates)


@pytest.mark.parametrize("turn", ["rotated", "flipped", "mirrored"])
@pytest.mark.parametrize("kind", ["rectangle", "disk"])
def test_what_lies_face_down_on_one_end_alone_is_refused(llvm_mono, kind, turn):
    """The LED is hidden, but light would go through; a plate on both ends in contact reads 0."""
    mi = llvm_mono
    place = mi.ScalarTransform4f().scale(0.2)
    turned = {"rotated": place.rotate([1, 0, 0], 180), "mirrored": place.scale([1, 1, -1])}.get(turn, place)
    flip = {"flip_normals": True} if turn == "flipped" else {}
    scene = rectangles().source
    scene["label"] = {"type": kind, "to_world": turned, "bsdf": ABSORBING, **flip}
    with pytest.raises(InputError, match=f"annular_led: the {kind} 'label' lies in its plane"):
        measure(Scene(scene), points=16)
    lid = mi.ScalarTransform4f().scale(10) @ turned
    del scene["label"]
    scene["plate"] = {"type": kind, "to_world": lid, "bsdf": ABSORBING, **flip}
    assert np.array_equal(measure(Scene(scene), points=64).power, [0.0])


@pytest.mark.parametrize("change, message", [
    ({"rfilter": {"type": "tent", "radius": 0.4}}, "rfilter must be a box"),
    ({"rfilter": {"type": "gaussian", "stddev": 0.1}}, "rfilter must be a box"),
    ({"crop_width": 1, "crop_height": 1, "crop_offset_x": 0, "crop_offset_y": 0}, "a crop is not allowed"),
])  # fmt: skip
def test_films_that_weight_light_are_refused(llvm_mono, change, message):
    with pytest.raises(InputError, match=f"^film: .*{message}"):
        given(whole_scene(), "reflector.sensor", "film", FILM | change).load()


def test_a_film_of_colours_is_refused(llvm_mono):
    """Grey light has an X of 0.95: Mitsuba's own integrators read 5 % too little."""
    llvm_mono.set_variant(llvm_mono.variant().replace("mono", "rgb"))
    for pixel_format in ("xyz", "xyza"):
        with pytest.raises(InputError, match="^film: pixel_format = 'xyz' is not allowed"):
            given(whole_scene(), "reflector.sensor", "film", FILM | {"pixel_format": pixel_format}).load()


@pytest.mark.parametrize("more", [
    {"sample_border": True}, {"component_format": "uint32"}, {"file_format": "rgbe"}, {"pixel_format": "rgb"}
])  # fmt: skip
def test_films_that_are_only_written_otherwise_read_the_same(llvm_mono, more):
    def read(film):
        scene = rectangles().source
        scene["integrator"] = {"type": "path"}
        scene["detector"]["sensor"] = {"type": "phototransistor", "film": film}
        return measure(Scene(scene), points=64, seed=1).power

    assert np.allclose(read(FILM | more), read(FILM), rtol=1e-6)
