"""Made-up studies whose right readings are known: stated errors of exported models, and noise as a force, to counts."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr

from mitsuba_taxel.characterise import volts_table
from mitsuba_taxel.electronics import Circuit, respond
from mitsuba_taxel.electronics.samples import sampled
from mitsuba_taxel.surrogates.onnx_model import study_error
from mitsuba_taxel.surrogates.polynomial import polynomial_of

POWER = 1e-3
"""In W, of an unloaded pad."""
NEW_INPUTS, SAMPLES = 5, 20
"""Readings of an exported model, and noisy samples of a circuit, for each made-up truth."""


def model_cases() -> dict[str, Callable[[int], dict[str, np.ndarray]]]:
    """By name: for a seed, errors of an exported model's readings, or of forces from counts, over the stated one."""
    export = {f"export: errors {kind}": partial(_exported, kind) for kind in ("of single readings", "common to all")}
    noise = {
        f"noise-equivalent force: {kind}": partial(_forces, kind) for kind in ("analogue noise", "steps of a converter")
    }
    return {**export, **noise}


def _exported(kind: str, seed: int) -> dict[str, np.ndarray]:
    """At random forces within the study, relative to the total error as share of full scale."""
    random = np.random.default_rng(seed)
    fx, fz = np.linspace(-2, 2, 5), np.linspace(0, -10, 11)
    right = _readings(fx[:, None], fz)
    size = 10 ** random.uniform(-4, -2) * right
    scatter = random.normal(size=right.shape if kind == "of single readings" else ())
    study = xr.Dataset(
        {
            name: (["fx", "fz", "taxel"], values)
            for name, values in (("power", right + scatter * size), ("total_error", size))
        },
        {"fx": fx, "fz": fz, "taxel": [1, 2]},
        {"curve": "fz"},
    )
    found = polynomial_of(study)
    total = np.hypot(found.rms, study_error(study).rms)
    new = np.stack([random.uniform(-2, 2, NEW_INPUTS), random.uniform(-10, 0, NEW_INPUTS)], axis=1)
    missed = found(new) - _readings(new[:, 0], new[:, 1])
    return {"reading": (missed / (total * np.ptp(study.power.values, axis=(0, 1)))).ravel()}


def _readings(fx: np.ndarray, fz: np.ndarray) -> np.ndarray:
    """(..., taxels) W, of two taxels that a tangential force tilts."""
    eased = 0.05 * fz * (1 - 0.02 * fz)
    return POWER * np.stack([np.exp(-eased * (1 + side * 0.1 * fx)) for side in (-1, 1)], axis=-1)


def _forces(kind: str, seed: int) -> dict[str, np.ndarray]:
    """Forces from the counts of noisy samples, read off the chord of the first step, over the stated noise as a
    force."""
    random = np.random.default_rng(seed)
    step = 10 ** random.uniform(-2, -1)
    bits, noise = (
        (16, 10 ** random.uniform(-4, -2)) if kind == "analogue noise" else (int(random.integers(6, 11)), 1e-5)
    )
    volts = random.uniform(0.3, 1.5)
    circuit = Circuit(supply=5.0, load_resistance=1e4, transfer=volts / 1e4 / POWER, adc_bits=bits, other_noise=noise)
    force = step * np.arange(0.0, -4.0, -1.0)
    power = _readings(np.zeros(4), force)[:, :1]
    study = xr.Dataset(
        {
            "power": (["fz", "taxel"], power),
            "total_error": (["fz", "taxel"], 0 * power),
            "replicate_power": (["replicate", "fz", "taxel"], np.tile(power, (2, 1, 1))),
        },
        {"fz": force, "taxel": [1]},
        {"curve": "fz"},
    )
    (stated,) = volts_table(study, circuit).noise_force_N
    pressed = -step * random.random(SAMPLES)
    ends = respond(circuit, power[:2, 0]).output
    counts = sampled(circuit, _readings(np.zeros(SAMPLES), pressed)[:, 0], random)[1]
    read = (circuit.step * (counts + 0.5) - ends[0]) / (ends[1] - ends[0]) * -step
    return {"force": (read - pressed) / stated}
