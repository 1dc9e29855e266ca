"""Coverage of the stated errors of exported models, and of the noise-equivalent forces of circuits, on synthetic
studies."""

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
"""Reading of an unloaded pad in W."""
NEW_INPUTS, SAMPLES = 5, 20
"""Number of readings of an exported model, and of noisy samples of a circuit, for each seed."""


def model_cases() -> dict[str, Callable[[int], dict[str, np.ndarray]]]:
    """All cases by name. A case is a function of a seed that returns true errors divided by the stated error.

    The errors are those of an exported model's readings, or of forces computed from counts of the converter.
    """
    export = {f"export: errors {kind}": partial(_exported, kind) for kind in ("of single readings", "common to all")}
    noise = {
        f"noise-equivalent force: {kind}": partial(_forces, kind) for kind in ("analogue noise", "steps of a converter")
    }
    return {**export, **noise}


def _exported(kind: str, seed: int) -> dict[str, np.ndarray]:
    """Errors of an exported model's readings at random forces within the study, divided by the stated total error."""
    random = np.random.default_rng(seed)
    fx, fz = np.linspace(-2, 2, 5), np.linspace(0, -10, 11)
    true_power = _readings(fx[:, None], fz)
    size = 10 ** random.uniform(-4, -2) * true_power
    scatter = random.normal(size=true_power.shape if kind == "of single readings" else ())
    study = xr.Dataset(
        {
            name: (["fx", "fz", "taxel"], values)
            for name, values in (("power", true_power + scatter * size), ("total_error", size))
        },
        {"fx": fx, "fz": fz, "taxel": [1, 2]},
        {"curve": "fz"},
    )
    polynomial = polynomial_of(study)
    total = np.hypot(polynomial.rms, study_error(study).rms)
    new_inputs = np.stack([random.uniform(-2, 2, NEW_INPUTS), random.uniform(-10, 0, NEW_INPUTS)], axis=1)
    residual = polynomial(new_inputs) - _readings(new_inputs[:, 0], new_inputs[:, 1])
    return {"reading": (residual / (total * np.ptp(study.power.values, axis=(0, 1)))).ravel()}


def _readings(fx: np.ndarray, fz: np.ndarray) -> np.ndarray:
    """Synthetic readings (..., taxels) in W of two taxels. A tangential force changes them in opposite directions."""
    loading = 0.05 * fz * (1 - 0.02 * fz)
    return POWER * np.stack([np.exp(-loading * (1 + side * 0.1 * fx)) for side in (-1, 1)], axis=-1)


def _forces(kind: str, seed: int) -> dict[str, np.ndarray]:
    """Errors of forces divided by the stated noise-equivalent force.

    The forces are computed from counts of noisy samples, by linear interpolation over the first load step.
    """
    # A circuit whose noise is analogue, or due to the steps of its converter.
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
    # The stated noise, and forces from the counts of samples at random forces within the first step.
    (noise_force,) = volts_table(study, circuit).noise_force_N
    pressed = -step * random.random(SAMPLES)
    ends = respond(circuit, power[:2, 0]).output
    counts = sampled(circuit, _readings(np.zeros(SAMPLES), pressed)[:, 0], random)[1]
    estimated = (circuit.step * (counts + 0.5) - ends[0]) / (ends[1] - ends[0]) * -step
    return {"force": (estimated - pressed) / noise_force}
