"""Light between points of walls, from arrays that end where memory ends."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

GUARDED = dedent("""
    import numpy as np
    from guarded_memory import guarded
    from mitsuba_taxel.transport.box import Box
    from mitsuba_taxel.transport.exchange import Exchange, Starts
    pairs, points = 1003, 517  # neither is a multiple of a packet
    random = np.random.default_rng(3)
    below, above = (random.uniform(-1, 1, (points, 3)) * (1, 1, 0) + (0, 0, z) for z in (0, 2))
    up = np.tile([0.0, 0.0, 1.0], (points, 1))
    starts = Starts(*map(guarded, (below, up, np.full(points, 0.3), np.full(points, 0.5))))
    start, end = (guarded(random.integers(points, size=pairs)) for _ in range(2))
    box = Box(np.array([0.0, 0.0, 1.0]), np.eye(3), np.full(3, 0.2))
    d = above[end] - below[start]
    cosine, squared = d[:, 2] / np.linalg.norm(d, axis=1), np.einsum("ij,ij->i", d, d)
    law = (0.3 / (2 * np.pi) + 0.5 * cosine / np.pi) * cosine / squared
    for between in (None, box):
        light = Exchange(starts, guarded(above), guarded(-up), start, end, between)
        values, slopes = light.values(), light.slopes(guarded(np.ones(pairs)))
        assert all(np.isfinite(part).all() for part in slopes.by_end + slopes.by_area + slopes.by_normal)
        if between is None:
            np.testing.assert_allclose(values, law, rtol=1e-12)
        else:
            assert ((values <= law * (1 + 1e-12)) & (values >= -1e-12 * law)).all() and (values < 0.5 * law).any()
""")


def test_nothing_is_read_beyond_the_end_of_arrays(llvm_mono):
    tests = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1] / "helpers")}
    done = subprocess.run([sys.executable, "-c", GUARDED], capture_output=True, text=True, env=tests)
    assert done.returncode == 0, done.stderr
