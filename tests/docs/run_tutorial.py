"""Do in the current folder what a tutorial tells its reader to do.

python run_tutorial.py TUTORIAL.md

Files shown under their name are written, `python` blocks run by one interpreter, `sh` blocks of nothing but `taxel` by
the same, as each program of its own would import all that it needs again, and other `sh` blocks by bash, in their
order. After each, the files that a comment `<!-- makes: a b -->` names must be there.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

from taxel_program import run_program

STEP = re.compile(
    r"^```(?P<language>sh|python)\n(?P<code>.*?)^```$"
    r"|^```\{code-block\} \w+\n:caption: (?P<name>\S+)\n\n(?P<text>.*?)^```$"
    r"|^<!-- makes: (?P<files>[^>]*) -->$",
    re.MULTILINE | re.DOTALL,
)
PLAIN = re.compile(r"(taxel [^|&;<>$`\\*?~#()]*\n)+")
"""Commands of `taxel` that need no shell."""


def run(tutorial: str) -> int:
    """Take all steps of a tutorial, and return how many there were.

    Raises
    ------
    subprocess.CalledProcessError, AssertionError, or whatever a Python block raises
    """
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    sys.path.insert(0, str(Path.cwd()))
    names: dict[str, object] = {"__name__": "__main__"}
    steps = list(STEP.finditer(tutorial))
    for step in steps:
        if step["language"] == "sh":
            _run_commands(step["code"])
        elif step["language"] == "python":
            line = tutorial[: step.start("code")].count("\n")
            exec(compile("\n" * line + step["code"], "tutorial", "exec"), names)
        elif step["name"]:
            Path(step["name"]).write_text(step["text"], encoding="utf-8")
        else:
            missing = [file for file in step["files"].split() if not Path(file).stat().st_size]
            assert not missing, missing
    return len(steps)


def _run_commands(code: str) -> None:
    if not PLAIN.fullmatch(code):
        subprocess.run(["bash", "-euo", "pipefail", "-c", code], check=True)
        return
    for command in code.splitlines():
        done = run_program(Path.cwd(), *shlex.split(command)[1:])
        print(done.stdout, done.stderr, sep="")
        done.check_returncode()


if __name__ == "__main__":
    assert run(Path(sys.argv[1]).read_text(encoding="utf-8")), "a tutorial without steps"
