"""Maps under a tangential load: the paper's Fig. 10 on synthetic readings, other directions and grids."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel import InputError
from mitsuba_taxel.characterise import experiments, symmetric_pairs, tangential_map, tangential_maps

FORCE = np.array([0.0, -2, -4, -8])


def load(direction, shape=(3, 3), odd=1e-4, even=1e-5, noise=0.0, **attrs) -> xr.Dataset:
    """A study of one tangential load: taxels change in proportion to how far ahead they lie, and all a little."""
    rows, columns = shape
    y, x = np.meshgrid((rows - 1) / 2 - np.arange(rows), np.arange(columns) - (columns - 1) / 2, indexing="ij")
    ahead = (x * direction[0] + y * direction[1]).ravel()
    power = 5e-3 + odd * FORCE[:, None] * ahead + even * FORCE[:, None] ** 2
    shared = np.random.default_rng(1).normal(size=(1, 32, 1)) * 1e-4
    samples = power[:, None] + shared + noise * np.random.default_rng(2).normal(size=(4, 32, rows * columns))
    coords = {"fx": ("step", FORCE * direction[0]), "fy": ("step", FORCE * direction[1]), "fz": ("step", [-8.0] * 4)}
    return xr.Dataset(
        {"replicate_power": (["step", "replicate", "taxel"], samples)},
        coords={"step": range(4), "taxel": range(1, rows * columns + 1), **coords},
        attrs=attrs,
    )


def pairs_of(table, mirror) -> list[tuple[int, int]]:
    rows = table[table.mirror == mirror]
    return list(zip(rows.taxel, rows.other, strict=True))


def test_secondary_diagonal(agree):
    """3 and 7 differ most, 2 and 4 as 6 and 8 half as much, and 1, 5, 9 not at all."""
    (taxels,) = tangential_maps(load((np.sqrt(0.5), np.sqrt(0.5)), noise=1e-7))
    assert taxels.force == pytest.approx(-8) and taxels.change.shape == (3, 3)
    agree(taxels.change[[0, 1, 2], [0, 1, 2]], taxels.error[[0, 1, 2], [0, 1, 2]], 64e-5)
    table = symmetric_pairs([taxels])
    assert pairs_of(table, "across") == [(2, 4), (3, 7), (6, 8)]
    assert pairs_of(table, "along") == [(1, 9), (2, 6), (4, 8)]
    half = -8e-4 * np.sqrt(2)
    agree(table.difference, table.error, [half, 2 * half, half, 0, 0, 0])
    assert (table.error < 1e-7).all() and set(table.unit) == {"W"} and set(table.at_N.round(9)) == {-8.0}


@pytest.mark.parametrize(
    "direction, across, along",
    [
        ((1, 0), [(1, 3), (4, 6), (7, 9)], [(1, 7), (2, 8), (3, 9)]),
        ((0, 1), [(1, 7), (2, 8), (3, 9)], [(1, 3), (4, 6), (7, 9)]),
        ((np.sqrt(0.5), -np.sqrt(0.5)), [(1, 9), (2, 6), (4, 8)], [(2, 4), (3, 7), (6, 8)]),
        ((0.6, 0.8), [], []),
    ],
)
def test_pairs_of_other_directions(direction, across, along):
    table = symmetric_pairs(tangential_maps(load(direction)))
    assert pairs_of(table, "across") == across and pairs_of(table, "along") == along
    assert (table[table.mirror == "along"].difference.abs() < 1e-15).all()


@pytest.mark.parametrize(
    "attrs", [{"rows": 6, "columns": 2}, {"parameters": json.dumps({"rows": "6", "columns": "2"})}]
)
def test_a_grid_of_six_by_two(attrs):
    table = symmetric_pairs(tangential_maps(load((1, 0), (6, 2), **attrs)))
    assert pairs_of(table, "across") == [(1, 2), (3, 4), (5, 6), (7, 8), (9, 10), (11, 12)]
    assert pairs_of(table, "along") == [(1, 11), (2, 12), (3, 9), (4, 10), (5, 7), (6, 8)]
    assert not len(symmetric_pairs(tangential_maps(load((np.sqrt(0.5), np.sqrt(0.5)), (6, 2), **attrs))))


def test_what_is_no_grid_or_no_tangential_load_is_refused():
    with pytest.raises(InputError, match="12 taxels do not form a square"):
        tangential_maps(load((1, 0), (6, 2)))
    (one,) = experiments(load((1, 0)))
    with pytest.raises(InputError, match="4 rows and 2 columns"):
        tangential_map(one, 4, 2)
    normal = load((1, 0)).drop_vars(["fx", "fy"]).assign_coords(fz=("step", FORCE))
    assert tangential_maps(normal) == []
    with pytest.raises(InputError, match="fz is not tangential"):
        tangential_map(experiments(normal)[0], 3, 3)


def test_a_tree_of_scenes():
    tree = xr.DataTree.from_dict({"flat": load((1, 0)), "round": load((0, 1))})
    table = symmetric_pairs(tangential_maps(tree))
    assert list(table.groupby("scene").force.unique().explode()) == ["fx", "fy"]
