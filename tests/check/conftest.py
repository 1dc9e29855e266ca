"""Fixtures of the checks of scenes."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="module")
def static():
    """What is found without deforming pads: the rest is in tests/properties/test_check_and_measure.py."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mitsuba_taxel.check.scene.check_prepared", lambda scene, parts: [])
        yield
