"""The table of the width of the horizon: what a row tells, and the page."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.evidence.domes import horizon
from mitsuba_taxel.evidence.domes.domes import dome_scene
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import HORIZON_SHARE, derivatives_by
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.diffuse import diffuse_cells
from mitsuba_taxel.transport import exchange


def test_rows_and_page(monkeypatch, tmp_path):
    """Readings v^3, whose derivatives are too large by a share of the width, and scatter by 1 % of their mean."""
    ripple = np.random.default_rng(0).normal(size=horizon.DESIGNS)
    places = iter(range(horizon.DESIGNS))

    def derivatives(value, parameter):
        scatter = 0.13 * ripple[next(places)]
        return [3 * value**2 * (1 + 0.01 * wider) + scatter for wider in horizon.WIDER]

    monkeypatch.setattr(horizon, "_derivatives", derivatives)
    monkeypatch.setattr(horizon, "_reading", lambda value: value**3)
    monkeypatch.setattr(horizon, "LINES", {"a line": (lambda value: value, "v", 1.0, 3.0)})
    rows = list(horizon.horizon())
    assert [row.width for row in rows] == [horizon.HORIZON * wider for wider in horizon.WIDER]
    for row, wider in zip(rows, horizon.WIDER, strict=True):
        assert row.bias == pytest.approx(0.01 * wider, abs=0.01)
        assert row.scatter == pytest.approx(0.01, rel=0.5)
    wide = np.sqrt(np.mean(np.square(3 * np.linspace(1, 3, horizon.DESIGNS) ** 2 / 13)))
    assert rows[1].stated == pytest.approx(HORIZON_SHARE * 0.01 * wide)
    horizon.write_page(rows, tmp_path / "page.md", "the command")
    page = (tmp_path / "page.md").read_text()
    assert page.count("| a line | v |") == len(horizon.WIDER) and "`the command`" in page
    assert "a width of 0.004 between walls" in page


def test_a_wider_horizon_of_a_scene_is_one_of_its_cells(monkeypatch):
    scene = dome_scene("parallelepiped", {"scattering": "isotropic"}, force=[0.5, 0, -1.0], mesh_size=2.5)
    live, change = scene.load(), [rates(scene, "fx")]
    plain, wider = (derivatives_by(change, live, with_errors=False, wider=each).values for each in (1, 3))
    diffuse_cells.kept_cell.cache_clear()  # and with it their gradients
    monkeypatch.setattr(exchange, "HORIZON", 3 * exchange.HORIZON)
    np.testing.assert_array_equal(derivatives_by(change, live, with_errors=False).values, wider)
    assert abs(wider / plain - 1) > 1e-4
