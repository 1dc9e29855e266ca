"""The file of a fitted material, which scenes use as ``material``, and its description for a terminal."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.fitting.material.curves import describe
from mitsuba_taxel.fitting.material.law_fit import LawFit
from mitsuba_taxel.fitting.material.material_fit import MaterialFit


def write_material(fit: MaterialFit, file: str | Path, title: str = "") -> None:
    """Write the best law as a TOML file; scenes name this file as their ``material``.

    Parameters
    ----------
    fit : MaterialFit
        Result of `fit_material`.
    file : str or Path
        File to be written.
    title : str
        Name of the silicone.

    Raises
    ------
    InputError
        if the law is refused.
    ComputationError
        if the file cannot be written.
    """
    best, path = fit.best, Path(file)
    law: Any = best.material
    names = ", ".join(curve.file for curve in fit.curves)
    lines = [
        f"# Fitted by `taxel material` to {names}.",
        f"title = {_value(title or path.stem)}",
        f"law = {_value(law.name)}",
        f"source = {_value(f'{best.candidate.label} fitted to {names} by least squares')}",
        f"largest_stretch = {fit.largest_stretch:.6g}    # principal stretch that the tests reach",
    ]
    if math.isfinite(best.stable):
        lines.append(f"stable_stretch = {best.stable:.6g}    # principal stretch up to which stress rises")
    if fit.relaxation:
        prony = "; ".join(f"{weight:.6g} {time:.6g}" for weight, time in fit.relaxation.prony)
        lines.append(f"prony = {_value(prony)}    # constants are instantaneous")
    lines += ["", "[constants]    # MPa; exponents and stretches without unit"]
    lines += [f"{name} = {getattr(law, name)!r}" for name in law.parameters]
    lines += ["", "[intervals]    # 95 %"]
    lines += [
        f"{name} = [{low:.6g}, {high:.6g}]"
        for name, low, high in zip(best.candidate.names, best.low, best.high, strict=True)
        if math.isfinite(low) and math.isfinite(high)
    ]
    lines += ["", "[covariance]", f"names = {_value(list(best.candidate.names))}", "rows = ["]
    lines += [f"  [{', '.join(f'{value:.6e}' for value in row)}]," for row in best.covariance]
    lines += ["]", "", "[ranking]    # cross-validated error, relative to the largest stress"]
    allowed = [other for other in fit.fits if not other.refusal]
    lines += [f"{_value(other.candidate.label)} = {other.cross_validated:.4g}" for other in allowed]
    if fit.relaxation:
        r = fit.relaxation
        lines += ["", "[relaxation]    # half-widths of 95 % intervals", f"file = {_value(r.file)}"]
        lines += [f"weight_errors = {_value([float(f'{e:.4g}') for e in r.weight_errors])}"]
        lines += [f"time_errors = {_value([float(f'{e:.4g}') for e in r.time_errors])}", f"rms = {r.rms:.4g}"]
    for curve, noise, stress, slack in zip(fit.curves, fit.noises, best.stress, best.slacks, strict=True):
        about = describe(curve)
        residual = (curve.stress - stress) / abs(curve.stress).max()
        lines += ["", "[[tests]]", *(f"{key} = {_value(value)}" for key, value in about.items())]
        lines += [f"noise = {noise.relative:.4g}    # of the largest stress", f"slack = {slack:.4g}"]
        lines += [f"rms = {float((residual**2).mean()) ** 0.5:.4g}", f"worst = {float(abs(residual).max()):.4g}"]
    write_text(path, "\n".join(lines) + "\n")


def _value(value: Any) -> str:
    """Text of a value (text, number or list) in TOML; text is written as a JSON string."""
    return json.dumps(value, ensure_ascii=False)


def material_answer(fit: MaterialFit) -> str:
    """State the best law and its constants with their errors, in one line.

    Parameters
    ----------
    fit : MaterialFit
        Result of `fit_material`.

    Returns
    -------
    str
        ``yeoh, 2 terms: c10 = 0.0536 ± 0.0004 MPa, c20 = ...; E = 0.32 MPa; ...``.
    """
    best = fit.best
    law: Any = best.material
    constants = ", ".join(f"{name} = {value} {unit}".rstrip() for name, value, unit in constant_rows(best))
    return (
        f"{best.candidate.label}: {constants}. E = {law.youngs_modulus:.4g} MPa at small strain, cross-validated error "
        f"{best.cross_validated:.2%} of the largest stress, up to a principal stretch of {fit.largest_stretch:.3g}."
    )


def constant_rows(fit: LawFit) -> list[tuple[str, str, str]]:
    """Table rows of the constants of a law: name, value with the larger half of its 95 % interval, and unit.

    Parameters
    ----------
    fit : LawFit
        A fitted law.

    Returns
    -------
    list[tuple[str, str, str]]
        Constants in the order of the law.
    """
    rows = []
    for name, value, low, high in zip(fit.candidate.names, fit.constants, fit.low, fit.high, strict=True):
        width = max(high - value, value - low)
        error = f"± {width:.2g}" if math.isfinite(width) else "(not determined)"
        rows.append((name, f"{value:.4g} {error}", "MPa" if name in fit.candidate.moduli else ""))
    return rows
