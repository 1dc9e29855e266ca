"""Examples of the page on simulators, in MuJoCo: depth, slip and contacts of balls are those of geometry."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_contact import linear_model

from mitsuba_taxel.surrogates import write_contact_model

mujoco = pytest.importorskip("mujoco")
pytestmark = pytest.mark.quick

PAGE = Path(__file__).parents[2] / "docs/howto/simulators.md"
BLOCK = re.compile(r"^:caption: (\S+)\n\n(.+?)\n```$", re.MULTILINE | re.DOTALL)
HAND = """
<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="pad" pos="0.1 0.2 0.3" euler="20 50 70">
      <geom type="box" size=".0022 .0022 .0015" pos="0 0 .0015"/>
    </body>
    <body name="ball"><freejoint/><geom type="sphere" size="{radius}" mass="1"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def page(tmp_path, monkeypatch):
    """Names of the page after its blocks with captions are run up to those for MuJoCo."""
    monkeypatch.chdir(tmp_path)
    write_contact_model(replace(linear_model(), places=np.array([[-1.0, -1.0], [1.0, 1.0]])), "contact.npz")
    names: dict = {}
    blocks = dict(BLOCK.findall(PAGE.read_text(encoding="utf-8")))
    for caption in ("depth_maps.py", "tactile.py", "slide.py", "contacts.py", "imperfect.py"):
        exec(blocks[caption].replace("PADS, STEP = 4096", "PADS, STEP = 3"), names)
    return names


def state(page, radius, place, depth, speed):
    """A ball in mm and mm/s, in the frame of a pad that is turned in space: model, data, and exact depth."""
    spec = mujoco.MjSpec.from_string(HAND.format(radius=1e-3 * radius))
    if int(mujoco.__version__.split(".")[0]) >= 4:
        page["add_touch"](spec, "pad")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    frame, pad = data.body("pad"), page["pad"]
    axes = frame.xmat.reshape(3, 3)
    data.qpos[:3] = frame.xpos + 1e-3 * axes @ [*place, pad.height + radius - depth]
    data.qvel[:3] = 1e-3 * axes @ speed
    mujoco.mj_forward(model, data)
    squares = ((pad.points[..., :2] - place) ** 2).sum(axis=-1)
    return model, data, np.where(squares < radius**2, np.sqrt(np.maximum(radius**2 - squares, 0)) - radius + depth, -1)


BALLS = [(4.0, (0.5, -0.3), 0.3, (40.0, -70.0, 20.0)), (2.0, (-0.4, 0.6), 0.2, (-5.0, 0.0, 0.0))]


@pytest.mark.skipif(int(mujoco.__version__.split(".")[0]) < 4, reason="the tactile sensor of older versions differs")
@pytest.mark.parametrize("ball", BALLS)
def test_the_tactile_sensor_has_the_depth_and_the_slip_of_a_ball(page, ball):
    radius, place, depth, speed = ball
    _, data, exact = state(page, *ball)
    maps, slip = page["touch"](data, "pad")
    below = maps > 0
    assert below.sum() > 5 and not (below & (exact <= 0)).any()
    squares = ((page["pad"].points[..., :2] - place) ** 2).sum(axis=-1)[below]
    shortest = 1e3 * data.sensor("pad").data[: maps.size].reshape(maps.shape)[below]
    np.testing.assert_allclose(shortest, radius - np.sqrt(squares + (radius - depth) ** 2), atol=1e-6)
    assert (slip[:, ~below] == 0).all()
    np.testing.assert_allclose(slip[:, below].T, np.tile(np.abs(speed[:2]), (below.sum(), 1)), atol=1e-6)


@pytest.mark.parametrize("turning", [(0.0, 0.0, 0.0), (0.7, -1.1, 2.0)])
def test_the_slide_of_a_ball_is_how_its_points_move_over_a_pad_that_moves(page, turning):
    """Differences of the places of points of both bodies in the frame of the pad, a microsecond later."""
    text = HAND.format(radius=4e-3).replace('euler="20 50 70">', 'euler="20 50 70"><freejoint/>')
    model = mujoco.MjSpec.from_string(text).compile()
    data, pad, tiny = mujoco.MjData(model), page["pad"], 1e-6
    data.qpos[7:10] = [0.101, 0.2, 0.31]
    data.qvel[:] = [0.02, -0.05, 0.01, 0.3, -0.2, 0.4, -0.03, 0.04, 0.02, *turning]
    mujoco.mj_forward(model, data)
    frame, ball = data.body("pad"), data.body("ball")
    own = 1e-3 * pad.points @ frame.xmat.reshape(3, 3).T + frame.xpos
    of_ball = (own - ball.xpos) @ ball.xmat.reshape(3, 3)
    found = page["slide"](model, data, "pad", "ball", 0.01)
    mujoco.mj_integratePos(model, data.qpos, data.qvel, tiny)
    mujoco.mj_kinematics(model, data)
    later = of_ball @ ball.xmat.reshape(3, 3).T + ball.xpos
    moved = (later - frame.xpos) @ frame.xmat.reshape(3, 3) - 1e-3 * pad.points
    expected = np.moveaxis(1e3 * moved[..., :2] * 0.01 / tiny, -1, 0)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("radius", [2.0, 4.0])
def test_depth_along_the_normal_has_the_force_of_the_exact_map(page, radius):
    pad = page["pad"]
    squares = ((pad.points[..., :2] - [0.3, -0.2]) ** 2).sum(axis=-1)
    exact = np.sqrt(np.maximum(radius**2 - squares, 0)) - radius + 0.4
    shortest = np.maximum(radius - np.sqrt(squares + (radius - 0.4) ** 2), 0)
    force, raw, mended = (pad(m).force[0, 2] for m in (exact, shortest, page["along_normal"](shortest)))
    off, left = {2.0: (0.057, 0.005), 4.0: (0.03, 0.002)}[radius]  # figures of the page
    assert raw / force - 1 == pytest.approx(-off, abs=0.001)
    assert abs(mended / force - 1) < left


@pytest.mark.parametrize("ball", BALLS)
def test_contacts_of_a_ball_give_its_depth_and_force(page, ball):
    model, data, exact = state(page, *ball)
    assert data.ncon == 1
    by_depth, by_force = page["read_contacts"](model, data, "pad", ball[0])
    np.testing.assert_allclose(by_depth.power, page["pad"](exact).power, rtol=1e-6)
    np.testing.assert_allclose(by_depth.force, page["pad"](exact).force, rtol=1e-6, atol=1e-12)
    # The force on the pad is opposite to that on the ball, whose mass is 1 kg.
    acceleration = data.qacc[:3] @ data.body("pad").xmat.reshape(3, 3)
    engine = page["contacts"](model, data, "pad")[3].sum(axis=0)
    assert engine[2] == pytest.approx(-acceleration[2], rel=1e-6) and engine[2] < 0
    assert by_force.force[0, 2] == pytest.approx(engine[2], rel=1e-6)
    np.testing.assert_allclose(by_force.centre[0], ball[1], atol=1e-6)
    data.qpos[2] += 0.1
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    for readings in page["read_contacts"](model, data, "pad", ball[0]):
        np.testing.assert_array_equal(readings.power[0], page["pad"].rest)


@pytest.mark.skipif(int(mujoco.__version__.split(".")[0]) < 4, reason="the tactile sensor of older versions differs")
def test_the_gripper_holds_the_egg_until_it_slips(page):
    blocks = dict(BLOCK.findall(PAGE.read_text(encoding="utf-8")))
    hand = blocks["hand.xml"].replace("0.002275", "0.0015").replace("0.032", "0.03045")  # the pad here is 3 mm high
    Path("hand.xml").write_text(hand, encoding="utf-8")
    for caption in ("grip.py", "plot_grip.py"):
        exec(blocks[caption], page)
    assert Path("grip.png").is_file()
    time, height, readings = page["time"], page["height"], page["readings"]
    deepest, slip = page["depth"].max(axis=(1, 2)), page["slip"].max(axis=(1, 2, 3))
    held, away = (time > 1.6) & (time < 2.0), time < 0.25
    assert np.ptp(height[held]) < 0.01 and height[held].min() > height[0] + 29  # lifted by 30 mm
    assert np.ptp(deepest[held]) < 0.01 and deepest[held].min() > 0.1 and slip[held].max() < 0.1
    assert (deepest[away] == 0).all() and height[-1] == pytest.approx(height[0], abs=1)  # on the table again
    falls = (time > 2.0) & (deepest > 0)
    assert slip[falls].max() > 10  # mm/s, before it falls
    # By symmetry about its middle, the centre of pressure is that of the pad, and the force falls as the hand opens.
    np.testing.assert_allclose(readings.centre[held], 0, atol=0.1)
    opening = (time > 2.05) & (deepest > 0.03)
    assert opening.sum() > 20 and (np.diff(-readings.force[opening, 2]) < 0).all()


def test_imperfect_pads_observe_counts_and_relaxing_forces(page):
    pad, depth = page["pad"], np.full((3, 11, 11), -1.0)
    depth[:2, 4:7, 4:7] = 0.1
    for _ in range(200):
        counts, force = page["observe"](depth)
    perfect = pad(depth)
    assert counts.shape == (3, 2) and np.abs(counts[2] - 500 * pad.rest / (5 / 4096)).max() < 3
    relaxed = 0.8 + 0.1 * np.exp(-2 / 0.5) + 0.1 * np.exp(-2 / 5)
    np.testing.assert_allclose(force[:, 2], relaxed * perfect.force[:, 2], rtol=0.01)
    depth[0] = np.nan
    counts, force = page["observe"](depth)
    assert (counts[0] == -1).all() and np.isnan(force[0]).all() and (counts[1:] >= 0).all()
