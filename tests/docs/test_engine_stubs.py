"""Examples of the page on simulators for engines that are not installed, against stubs of their documentation.

The stubs know a ball above each of two pads. What an engine does otherwise is not tested.
"""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from made_up_contact import linear_model

from mitsuba_taxel.surrogates import write_contact_model

pytestmark = pytest.mark.quick

PAGE = Path(__file__).parents[2] / "docs/howto/simulators.md"
BLOCK = re.compile(r"^:caption: (\S+)\n\n(.+?)\n```$", re.MULTILINE | re.DOTALL)
RADIUS, DEPTHS, PLACES = 4.0, (0.3, 0.2), ((0.5, -0.3), (-0.4, 0.7))
"""Radius of the ball, its depths and places on the two pads, in mm."""


class Tensor:
    """What the examples use of a tensor of torch."""

    def __init__(self, values):
        self.values = np.asarray(values)

    def __getitem__(self, index):
        return Tensor(self.values[index])

    def cpu(self):
        return self

    def numpy(self):
        return self.values


def distances(points):
    """Signed distances in m of points (N, 3) in m from the balls: (2, N), negative inside."""
    height = linear_model().height
    centres = np.array([[*place, height + RADIUS - depth] for place, depth in zip(PLACES, DEPTHS, strict=True)])
    return np.linalg.norm(points - 1e-3 * centres[:, None], axis=-1) - 1e-3 * RADIUS


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Runs a block of the page with stub modules, and returns its names."""
    monkeypatch.chdir(tmp_path)
    write_contact_model(replace(linear_model(), places=np.array([[-1.0, -1.0], [1.0, 1.0]])), "contact.npz")
    blocks = dict(BLOCK.findall(PAGE.read_text(encoding="utf-8")))

    def block(caption, **modules):
        names: dict = {}
        for name, members in modules.items():
            module = ModuleType(name.replace("__", "."))
            vars(module).update(members)
            monkeypatch.setitem(sys.modules, name.replace("__", "."), module)
        exec(blocks["depth_maps.py"], names)
        exec(blocks[caption], names)
        return names

    return block


def exact(pad):
    """Readings of the depth of the balls along the normal."""
    squares = np.stack([((pad.points[..., :2] - place) ** 2).sum(axis=-1) for place in PLACES])
    return pad(np.sqrt(np.maximum(RADIUS**2 - squares, 0)) - RADIUS + np.array(DEPTHS)[:, None, None])


def compare(readings, expected, tolerance):
    """Both pads have their readings and forces, within a fraction of the largest."""
    assert readings.power.shape == (2, 2) and readings.inside.all() and expected.inside.all()
    for name in ("force", "moment", "centre"):
        values = getattr(expected, name)
        np.testing.assert_allclose(getattr(readings, name), values, atol=tolerance * np.abs(values).max())
    change = np.abs(expected.power - expected.power.min()).max()
    np.testing.assert_allclose(readings.power, expected.power, atol=tolerance * change)


def test_mjlab_reads_both_pads(run):
    members = {"ObjRef": SimpleNamespace, "TactileSensorCfg": SimpleNamespace}
    names = run("pad_mjlab.py", mjlab={}, mjlab__sensor=members)
    cfg, pad = names["touch_cfg"], names["pad"]
    x, y = (np.linspace(-size / 2, size / 2, count) for size, count in zip(cfg.size, cfg.resolution, strict=True))
    points = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full(cfg.resolution, cfg.pos[2])], axis=-1)
    depth = np.maximum(-distances(points.reshape(-1, 3)), 0).reshape(-1, *cfg.resolution)
    scene = {"robot/touch": SimpleNamespace(data=SimpleNamespace(depth=Tensor(depth)))}
    compare(names["read_pads"](scene), exact(pad), 0.02)


def test_genesis_reads_both_pads(run):
    class Probes(SimpleNamespace):
        def read(self, envs_idx=None):
            depth = np.maximum(self.probe_radius - distances(self.probe_local_pos), 0)
            return Tensor(depth if envs_idx is None else depth[envs_idx])

    names = run("pad_genesis.py", genesis={"sensors": SimpleNamespace(ContactDepthProbe=Probes)})
    scene = SimpleNamespace(add_sensor=lambda options: options)
    sensor = names["PadSensor"](scene, SimpleNamespace(idx=1), SimpleNamespace(idx_local=2))
    assert (sensor.probes.entity_idx, sensor.probes.link_idx_local) == (1, 2)
    expected = exact(names["pad"])
    compare(sensor.read(), expected, 0.005)
    np.testing.assert_allclose(sensor.read([1]).force, expected.force[1:], atol=0.005)


def test_isaac_lab_reads_both_pads(run):
    class VisuoTactileSensor:
        """Points by rows of x, then y, and their depths, as the sensor of TacSL has them."""

        def __init__(self, cfg):
            self.cfg, self._data = cfg, SimpleNamespace()
            x, y = (np.linspace(-2.2e-3, 2.2e-3, count) for count in cfg.tactile_array_size)
            corners = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full(cfg.tactile_array_size, 3e-3)], axis=-1)
            self._tactile_pos_local = Tensor(corners.reshape(-1, 3))

        def _update_buffers_impl(self, env_mask):
            depth = np.maximum(-distances(self._tactile_pos_local.values), 0)
            self._data.penetration_depth = Tensor(depth)

    folder = "isaaclab_contrib__sensors__tacsl_sensor"
    names = run(
        "pad_isaac.py",
        isaaclab_contrib={},
        isaaclab_contrib__sensors={},
        **{folder: {"VisuoTactileSensor": VisuoTactileSensor}},
    )
    sensor = names["PadSensor"](SimpleNamespace(tactile_array_size=(20, 25)))
    sensor._update_buffers_impl(None)
    compare(sensor._data.pad, exact(names["pad"]), 0.04)


def test_the_node_of_ros_publishes_the_reading_of_an_image(run):
    class Node:
        def __init__(self, name):
            self.name, self.sent = name, []

        def create_publisher(self, kind, topic, depth):
            return SimpleNamespace(publish=self.sent.append)

        def create_subscription(self, kind, topic, callback, depth):
            self.topic, self.callback = topic, callback

    def message(**fields):
        vectors = {"force": SimpleNamespace(), "torque": SimpleNamespace()}
        return SimpleNamespace(wrench=SimpleNamespace(**vectors), **fields)

    modules = {"rclpy": {}, "rclpy__node": {"Node": Node}, "pad_msgs": {}, "pad_msgs__msg": {"PadReading": message}}
    names = run("pad_node.py", sensor_msgs={}, sensor_msgs__msg={"Image": object}, **modules)
    node, pad = names["PadNode"](), names["pad"]
    squares = ((pad.points[..., :2] - PLACES[0]) ** 2).sum(axis=-1)
    depth = (1e-3 * (np.sqrt(RADIUS**2 - squares) - RADIUS + DEPTHS[0])).astype(np.float32)
    header = object()
    node.callback(SimpleNamespace(data=depth.tobytes(), height=11, width=11, header=header))
    (sent,), readings = node.sent, exact(pad)
    assert sent.header is header and sent.status == 0 and node.topic == "depth"
    np.testing.assert_allclose(sent.power, readings.power[0], rtol=1e-4)
    force, torque = (vector for vector in (sent.wrench.force, sent.wrench.torque))
    np.testing.assert_allclose([force.x, force.y, force.z], readings.force[0], rtol=1e-4)
    np.testing.assert_allclose([torque.x, torque.y, torque.z], 1e-3 * readings.moment[0], rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(sent.centre_of_pressure, 1e-3 * readings.centre[0], rtol=1e-4)
