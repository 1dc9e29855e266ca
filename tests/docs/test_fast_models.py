"""What the page on models over total forces shows works as it stands there: a bare Python, and MuJoCo."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.surrogates import export

pytestmark = pytest.mark.quick

PAGE = Path(__file__).parents[2] / "docs/howto/fast_models.md"
PRESS = """
<mujoco>
  <worldbody>
    <body name="pad">
      <joint name="along" type="slide" axis="1 0 0"/>
      <geom type="box" size=".01 .01 .01" mass="1"/>
      <site name="board"/>
    </body>
  </worldbody>
  <sensor>
    <force name="pad_force" site="board"/>
    <user name="pad_light" dim="9" needstage="acc" datatype="real"/>
  </sensor>
</mujoco>
"""
"""A body of 1 kg that slides freely along x: its own weight of 9.81 N is what the force sensor reads along z."""


def test_the_page_fills_a_sensor_of_mujoco(tmp_path, monkeypatch):
    pytest.importorskip("onnxruntime")
    mujoco = pytest.importorskip("mujoco")
    fx, fz = np.linspace(-2, 2, 5), np.linspace(0, 12, 4)
    power = 4e-3 * (1 + 0.01 * (fx[:, None, None] + np.arange(9) * fz[:, None]))
    coords = {"fx": ("fx", fx, {"units": "N"}), "fz": ("fz", fz, {"units": "N"}), "taxel": range(1, 10)}
    about = dict.fromkeys(("scene", "parameters", "seed", "points", "versions"), "")
    data = {"power": (("fx", "fz", "taxel"), power), "total_error": (("fx", "fz", "taxel"), 1e-3 * power)}
    study = xr.Dataset(data, coords, {"curve": "fz", **about})
    monkeypatch.chdir(tmp_path)
    export(study, "model.onnx")
    model = mujoco.MjModel.from_xml_string(PRESS)  # before the callback, which the page advises
    names: dict = {}
    for block in re.findall(r"^```python\n(.+?)\n```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL):
        exec(block, names)
    assert names["readings"].shape == (1, 9) and not names["inside"][0]  # -3 N pulls at this one
    try:
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        expected = 4e-3 * (1 + 0.01 * np.arange(9) * abs(data.sensor("pad_force").data[2]))
        np.testing.assert_allclose(data.sensor("pad_light").data, expected, rtol=1e-6)
        model.opt.gravity[2] = -20  # more than the study covers
        mujoco.mj_forward(model, data)
        assert np.isnan(data.sensor("pad_light").data).all()
    finally:
        mujoco.set_mjcb_sensor(None)
