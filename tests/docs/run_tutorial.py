"""Do in the current folder what a tutorial tells its reader to do.

python run_tutorial.py TUTORIAL.md [--renew]

Files shown under their name are written, `python` blocks run by one interpreter, `sh` blocks of nothing but `taxel` by
the same, as each program of its own would import all that it needs again, and other `sh` blocks by bash, in their
order. After each, the files that a comment `<!-- makes: a b -->` names must be there, and a `text` block must be a part
of what was printed since the one before it; `--renew` writes the numbers of today into it instead. Figures are drawn,
and written blank.
"""

from __future__ import annotations

import io
import os
import re
import shlex
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

from blank_figures import blank_figures
from listings import missing_from, renewed
from taxel_program import run_program

STEP = re.compile(
    r"^```(?P<language>sh|python)\n(?P<code>.*?)^```$"
    r"|^```text\n(?P<shown>.*?)^```$"
    r"|^```\{code-block\} \w+\n:caption: (?P<name>\S+)\n\n(?P<text>.*?)^```$"
    r"|^<!-- makes: (?P<files>[^>]*) -->$",
    re.MULTILINE | re.DOTALL,
)
PLAIN = re.compile(r'(taxel ([^|&;<>$`\\*?~#()"]|"[^"$`\\]*")*\n)+')
"""Commands of `taxel` that need no shell."""


def run(page: Path, renew: bool) -> int:
    """Take all steps of a tutorial, and return how many there were.

    Raises
    ------
    subprocess.CalledProcessError, AssertionError, or whatever a Python block raises
    """
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    sys.path.insert(0, str(Path.cwd()))
    tutorial = page.read_text(encoding="utf-8")
    names: dict[str, object] = {"__name__": "__main__"}
    steps = list(STEP.finditer(tutorial))
    printed = ""
    for step in steps:
        if step["language"] == "sh":
            printed += _run_commands(step["code"])
        elif step["language"] == "python":
            line = tutorial[: step.start("code")].count("\n")
            with redirect_stdout(io.StringIO()) as told:
                exec(compile("\n" * line + step["code"], "tutorial", "exec"), names)
            printed += told.getvalue()
        elif step["shown"]:
            wrong = missing_from(step["shown"], printed)
            if renew:
                today = page.read_text(encoding="utf-8").replace(step["shown"], renewed(step["shown"], printed))
                page.write_text(today, encoding="utf-8")
            assert renew or not wrong, wrong
            printed = ""
        elif step["name"]:
            Path(step["name"]).write_text(step["text"], encoding="utf-8")
        else:
            missing = [file for file in step["files"].split() if not Path(file).stat().st_size]
            assert not missing, missing
    return len(steps)


def _run_commands(code: str) -> str:
    """What was printed."""
    if not PLAIN.fullmatch(code):
        bash = ["bash", "-euo", "pipefail", "-c", code]
        return subprocess.run(bash, check=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True).stdout
    printed = ""
    for command in code.splitlines():
        done = run_program(Path.cwd(), *shlex.split(command)[1:])
        printed += done.stdout + done.stderr
        if done.returncode:
            print(printed)
        done.check_returncode()
    return printed


if __name__ == "__main__":
    with blank_figures():
        assert run(Path(sys.argv[1]), "--renew" in sys.argv), "a tutorial without steps"
