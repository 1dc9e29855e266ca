"""The example of the page on contact models, in MuJoCo: readings under a ball are those of its depth map."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_contact import linear_model

from mitsuba_taxel.surrogates import read_contact_model, write_contact_model

pytestmark = pytest.mark.quick

PAGE = Path(__file__).parents[2] / "docs/howto/contact_models.md"
HAND = """
<mujoco>
  <worldbody>
    <body name="pad" pos="0.1 0.2 0.3" euler="0 90 0">
      <geom type="box" size=".0022 .0022 .0015" pos="0 0 .0015" contype="0" conaffinity="0"/>
      <site name="board"/>
    </body>
    <body name="ball" mocap="true"><geom type="sphere" size=".004" contype="0" conaffinity="0"/></body>
  </worldbody>
  <sensor><user name="pad_light" dim="2" needstage="acc" datatype="real"/></sensor>
</mujoco>
"""
"""A pad of 3 mm height on its side: its z axis is the x axis of the world, its x axis points down."""


def test_the_page_reads_a_ball_of_mujoco(tmp_path, monkeypatch):
    mujoco = pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    write_contact_model(replace(linear_model(), places=np.array([[-1.0, -1.0], [1.0, 1.0]])), "contact.npz")
    pad = read_contact_model("contact.npz")
    (block,) = re.findall(r"^:caption: contact.py\n\n(.+?)\n```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    model = mujoco.MjModel.from_xml_string(HAND)
    try:
        exec(block, {})
        data = mujoco.MjData(model)
        for place, depth in (((0.5, -0.3), 0.2), ((-0.7, 0.4), 0.35), ((0.0, 0.0), -0.1)):
            x, y, z = 1e-3 * np.array([*place, pad.height + 4.0 - depth])  # centre of the ball, in the frame of the pad
            data.mocap_pos[0] = np.array([0.1, 0.2, 0.3]) + [z, y, -x]
            mujoco.mj_forward(model, data)
            distance = np.hypot(pad.points[..., 0] - place[0], pad.points[..., 1] - place[1])
            expected = pad(depth - 4.0 + np.sqrt(np.maximum(16.0 - distance**2, 0.0)))
            assert expected.inside[0] and (expected.force[0, 2] < 0) == (depth > 0)
            np.testing.assert_allclose(data.sensor("pad_light").data, expected.power[0], rtol=1e-6)
        data.mocap_pos[0, 0] -= 1e-3  # deeper than the model holds
        mujoco.mj_forward(model, data)
        assert np.isnan(data.sensor("pad_light").data).all()
    finally:
        mujoco.set_mjcb_sensor(None)
