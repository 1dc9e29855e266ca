"""`taxel doctor`: versions of this installation, and a check of known results."""

from __future__ import annotations

import click

from ..options import debug_option, json_option


@click.command(short_help="Check the installation.")
@json_option
@debug_option
@click.pass_context
def command(ctx: click.Context, as_json: bool) -> None:
    """Print versions, LLVM, graphics card, variants, plugins and solvers; check optics and mechanics.

    The optics are checked in the variant that is used: `taxel --variant cuda_ad_mono doctor` checks a graphics card.
    """
    from mitsuba_taxel import backend
    from mitsuba_taxel.check.selfcheck import run_checks
    from mitsuba_taxel.mechanics import available_solvers

    from ..tables import print_json, say

    facts = backend.report() | {"linear solvers": available_solvers()}
    checks = run_checks()
    if as_json:
        print_json(facts | {"checks": [check._asdict() for check in checks]})
    else:
        failed = [check.name for check in checks if not check.passed]
        say(f"The installation fails in: {', '.join(failed)}." if failed else "The installation works.")
        for check in checks:
            say(f"{check.name} {'ok' if check.passed else 'FAILED'}: {check.detail}")
        for name, fact in facts.items():
            say(f"{name}: {_words(fact)}")
        if remark := backend.work_of_processor(backend.wanted_variant()):
            say(remark)
    ctx.exit(0 if all(check.passed for check in checks) else 1)


def _words(fact: object) -> str:
    if isinstance(fact, dict):
        return ", ".join(f"{name} {value}" for name, value in fact.items())
    return ", ".join(map(str, fact)) if isinstance(fact, (list, tuple)) else str(fact)
