"""Solutions kept apart from the user's."""

from __future__ import annotations

import pytest


@pytest.fixture
def own_solutions(tmp_path_factory, monkeypatch):
    """Keep the solutions of a test away from the user's, for others like it."""
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path_factory.getbasetemp() / "solutions"))
