"""What hides the ways of light between walls."""

from __future__ import annotations

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import Scene
from mitsuba_taxel.backend import llvm
from mitsuba_taxel.sensing.diffuse.deterministic_light import deterministic_light
from mitsuba_taxel.sensing.diffuse.diffuse_cells import CLEARANCE, COVER, DiffuseCells
from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse

LOWER = np.array([[0.2, 0.1, 0.7], [0.0, 0.0, 1.0]])
"""A point above the package with its normal."""


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    file = tmp_path_factory.mktemp("cell") / "cell.xml"
    file.write_text(one_cell(cell="parallelepiped", mesh_size=1.25, scattering="isotropic", fz=0))
    return DiffuseCells(Scene(file).load())


@pytest.mark.parametrize(("covered", "hidden"), [(0.0, 0.0), (0.5 * COVER, 0.0), (2 * COVER, 1.0)])
@pytest.mark.parametrize("upwards", [False, True])
def test_the_little_silicone_that_covers_an_end_hides_nothing(cells, covered, hidden, upwards):
    """Ends on the roof and up to so many clearances behind it, from both sides."""
    top = cells.pad.pad.top_of_cell
    depth = covered * CLEARANCE * (top - LOWER[0, 2])
    upper = np.array([[0.0, 0.0, top + depth], [0.0, 0.0, -1.0]])
    way = (LOWER[None], upper[None]) if upwards else (upper[None], LOWER[None])
    assert cells.occluded_fraction(*way, np.ones(1)) == hidden


def test_a_wall_in_between_hides(cells):
    """A way from within the cell to beyond the pad."""
    beyond = np.array([[20.0, 0.0, 0.7], [-1.0, 0.0, 0.0]])
    assert cells.occluded_fraction(LOWER[None], beyond[None], np.full(1, 0.25)) == 0.25


def test_without_an_llvm_random_paths_are_needed(cells, monkeypatch):
    """As on a machine with a graphics card alone, where one of Dr.Jit's arrays for LLVM would end the process."""
    assert deterministic_light(cells.scene) is not None
    monkeypatch.setattr(llvm, "is_fit", lambda: False)
    assert deterministic_light(cells.scene) is None
    with pytest.raises(NotDiffuse, match="needs an LLVM of version 19 or newer"):
        DiffuseCells(cells.scene)
