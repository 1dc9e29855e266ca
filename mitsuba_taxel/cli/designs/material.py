"""`taxel material`: a material law from tests of a silicone."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import debug_option, json_option, output_option

_PATH = click.Path(path_type=Path)


@click.command(short_help="A material law from tests of a silicone.")
@click.argument("tests", nargs=-1, type=_PATH, metavar="TEST.csv...")
@click.option(
    "--compression", multiple=True, type=_PATH, metavar="FILE",
    help="Uniaxial test that counts compression as positive.",
)  # fmt: skip
@click.option("--planar", multiple=True, type=_PATH, metavar="FILE", help="Planar tension (pure shear).")
@click.option("--biaxial", multiple=True, type=_PATH, metavar="FILE", help="Equibiaxial tension.")
@click.option("--relaxation", type=_PATH, metavar="FILE", help="Stress over time at a constant strain: Prony series.")
@click.option("--area", type=float, metavar="MM2", help="Undeformed cross-section, needed for columns of force.")
@click.option("--length", type=float, metavar="MM", help="Undeformed length, needed for columns of extension.")
@click.option("--true-stress", is_flag=True, help="Stresses are forces per deformed area.")
@click.option("--up-to", type=float, metavar="STRAIN", help="Largest nominal strain to fit, such as that of the pad.")
@click.option("--name", default="", help="Name of the silicone in the file.")
@output_option("material.toml", "The material, for scenes; a plot is written beside it.")
@json_option
@debug_option
def command(
    tests: tuple[Path, ...],
    compression: tuple[Path, ...],
    planar: tuple[Path, ...],
    biaxial: tuple[Path, ...],
    relaxation: Path | None,
    area: float | None,
    length: float | None,
    true_stress: bool,
    up_to: float | None,
    name: str,
    output: Path,
    as_json: bool,
) -> None:
    """Fit material laws to tables of strain and stress, and write the best one for `material` of a scene.

    TEST.csv are uniaxial tests with a column such as `strain [%]`, `stretch` or `extension [mm]`, and one such as
    `stress [kPa]`, `[psi]` or `force [N]`; compression is negative. Laws are ranked by their cross-validated error.
    """
    from mitsuba_taxel.base.files.atomic import replacing
    from mitsuba_taxel.fitting.material.material_fit import fit_material
    from mitsuba_taxel.fitting.material.written import write_material
    from mitsuba_taxel.plots.material import plot_material

    from ..tables import print_json, say

    fit = fit_material(
        tests, compression=compression, planar=planar, equibiaxial=biaxial, relaxation=relaxation, area=area,
        length=length, true_stress=true_stress, up_to=up_to,
    )  # fmt: skip
    write_material(fit, output, name)
    shown = [other for other in fit.fits if not other.refusal][:3]
    figure = plot_material(fit.curves, [(f.candidate.label, f.stress) for f in shown], fit.relaxation)
    plot = output.with_suffix(".png")
    with replacing(plot) as new:
        figure.savefig(new, format="png")
    if as_json:
        print_json({**_as_json(fit), "file": str(output), "plot": str(plot)})
        return
    _show(fit)
    say(f'Results: {output} and {plot}. In a scene: material="{output.name}".')


def _as_json(fit) -> dict[str, object]:
    from ..tables import records

    best = fit.best
    constants = {
        name: {"value": float(value), "low": float(low), "high": float(high)}
        for name, value, low, high in zip(best.candidate.names, best.constants, best.low, best.high, strict=True)
    }
    return {
        "law": best.candidate.label,
        "constants": constants,
        "largest_stretch": fit.largest_stretch,
        "ranking": records(fit.ranking),
        "prony": fit.relaxation.prony if fit.relaxation else [],
        "warnings": fit.warnings,
        "notes": fit.notes,
    }


def _show(fit) -> None:
    from mitsuba_taxel.fitting.material.written import material_answer

    from ..tables import print_notes, print_table, say

    say(f"{material_answer(fit)}\n")
    rows = []
    for other in fit.fits:
        stable = "all" if other.stable == float("inf") else f"{other.stable:.3g}"
        errors = (f"{other.cross_validated:.2%}", f"{other.rms:.2%}", f"{other.misfit:.2f}")
        count, word = str(len(other.constants)), "refused" if other.refusal else ""
        rows.append((other.candidate.label, count, *errors, stable, word))
    print_table(("law", "constants", "cross-validated", "rms", "over noise", "stable up to", ""), rows)
    say("Errors are relative to the largest stress; intervals are of 95 %; stretches are principal.")
    for other in fit.fits:
        if other.refusal:
            say(f"{other.candidate.label} is refused: {other.refusal}")
    for curve, noise in zip(fit.curves, fit.noises, strict=True):
        say(
            f"{curve.file}: {curve.mode}, {len(curve.lines)} rows, strain {curve.strain.min() + 0.0:.3g} to "
            f"{curve.strain.max() + 0.0:.3g}, noise {noise.relative:.2%} of the largest stress"
        )
    if fit.relaxation:
        pairs = zip(fit.relaxation.prony, fit.relaxation.weight_errors, fit.relaxation.time_errors, strict=True)
        say()
        print_table(
            ("Prony weight", "time [s]"), ((f"{g:.4g} ± {dg:.2g}", f"{t:.4g} ± {dt:.2g}") for (g, t), dg, dt in pairs)
        )
    print_notes(fit)
