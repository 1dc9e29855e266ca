"""The `taxel` program: one small module per subcommand, in a folder for each group, imported when it is called.

It is installed as the package ``taxel_cli``, beside ``mitsuba_taxel`` and not inside it: importing anything from
``mitsuba_taxel`` loads mitsuba, but help and error messages must work even if that is slow or fails.
"""

from __future__ import annotations

from . import interrupts  # isort: skip

import io
import os
import re
import signal
import sys
import traceback
import warnings
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click

from .options import debug_option

COMMANDS = (
    "new", "check", "render", "rays", "picture", "sweep", "status", "characterise", "compare", "tolerance", "fit",
    "material", "optimise", "report", "export", "calibrate", "dataset", "deform", "parts", "plugins", "bench",
    "reproduce", "validate", "doctor", "cache",
)  # fmt: skip
VARIANTS = ("llvm_ad_mono", "llvm_ad_rgb", "cuda_ad_mono", "cuda_ad_rgb")
"""Variants that the package supports. They are repeated here, because help must not import the package."""


_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
_ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))


class _Ended(Exception):
    """A signal has terminated the program."""

    def __init__(self, signal: signal.Signals) -> None:
        self.signal = signal


class _Commands(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        (file,) = Path(__file__).parent.glob(f"*/{cmd_name}.py")
        return import_module(f".{file.parent.name}.{cmd_name}", __package__).command

    def invoke(self, ctx: click.Context) -> Any:
        try:
            try:
                return super().invoke(ctx)
            except RuntimeError as error:
                str(error)  # the message of the end of a load path may take a solution, which may be interrupted
                raise
        except BaseException as error:  # an interrupt may be wrapped in another error
            if ctx.obj.ended:
                raise _Ended(ctx.obj.ended[0]) from error
            raise


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="mitsuba_taxel", prog_name="taxel")
@click.option(
    "--plugin", "plugins", multiple=True, type=click.Path(path_type=Path), metavar="FILE.py",
    help="Python file that registers Mitsuba plugins; it is run, here and in worker processes. May be repeated.",
)  # fmt: skip
@click.option(
    "--variant", type=click.Choice(VARIANTS), help="Variant of Mitsuba, here and in workers on this machine. Variants "
    "of cuda trace random paths on an NVIDIA card; mechanics, and light without random numbers, use the processor.",
    show_default=f"MITSUBA_TAXEL_VARIANT, or {VARIANTS[0]}",
)  # fmt: skip
@debug_option
def taxel(plugins: tuple[Path, ...], variant: str | None) -> None:
    """Simulate optoelectronic tactile sensors: force, deformed pad, light, reading.

    SCENE is a Mitsuba XML file, or the name of a scene that ships with the package (gel.xml, hexagonal.xml, pad.xml,
    plate.xml).
    Units are mm, N, MPa, W and s.
    """
    if variant:
        os.environ["MITSUBA_TAXEL_VARIANT"] = variant
    if plugins:
        from mitsuba_taxel.backend.own_plugins import load_plugins

        load_plugins(*plugins)


def main() -> None:
    """Run the program.

    Exit codes: 0 done, 1 failed computation, 2 bad input, 3 done but beyond the target error, 130 interrupted, 128 + n
    terminated by signal n.
    """
    _keep_stdout_for_results()
    _let_blas_have_one_thread()
    os.environ.setdefault("PYTHONSAFEPATH", "1")  # processes of this one import nothing from the working directory
    warnings.showwarning = _show_warning
    settings = SimpleNamespace(debug=False, ended=_signals_as_interrupts())
    try:
        _require_working_directory()
        status = taxel.main(obj=settings, prog_name="taxel", standalone_mode=False)
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader has closed the pipe
        status = 1
    except click.exceptions.NoArgsIsHelpError as request:
        request.show()
        status = request.exit_code
    except (KeyboardInterrupt, click.Abort):
        click.echo("taxel: interrupted", err=True)
        status = 130
    except Exception as error:
        if settings.debug:
            traceback.print_exception(error)
        message, status = _describe(error)
        if isinstance(error, OSError) and error.filename is None and _stdout_is_full():
            message = f"standard output cannot be written: {error.strerror or error}"
        click.echo(f"taxel: {' '.join(message.split())}", err=True)
    sys.exit(status)


def _let_blas_have_one_thread() -> None:
    """Limit BLAS to one thread unless the user sets another number: for small products, more threads cost time."""
    if "OMP_NUM_THREADS" not in os.environ:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _signals_as_interrupts() -> list[signal.Signals]:
    """Treat terminating signals as interrupts, so that child processes end and results are kept.

    Returns
    -------
    list[signal.Signals]
        List to which the first received signal is added; later signals are ignored.
    """
    received: list[signal.Signals] = []

    def end(number: int, frame: object) -> None:
        received.append(signal.Signals(number))
        for ending in _ENDING:
            signal.signal(ending, signal.SIG_IGN)
        raise KeyboardInterrupt

    for number in _ENDING:
        if signal.getsignal(number) is signal.SIG_DFL:  # nohup leaves it ignored
            signal.signal(number, end)
    return received


def _describe(error: Exception) -> tuple[str, int]:
    """Text and exit code for an error that ends the program."""
    kinds = sys.modules.get("mitsuba_taxel.base.errors")
    if isinstance(error, _Ended):
        return f"ended by {error.signal.name}", 128 + error.signal
    if kinds is not None and kinds.comes_from_interrupt(error):
        return "interrupted", 130
    if isinstance(error, click.ClickException):
        return f"{error.format_message()}{_where_to_look(error)}", 2
    if kinds is not None and isinstance(error, kinds.InputError):
        return str(error), 2
    if kinds is not None and isinstance(error, kinds.ComputationError):
        return str(error), 1
    if type(error) is ImportError and error.name is None:  # our own messages on the installation
        return str(error), 1
    if isinstance(error, MemoryError):
        return "there is not enough memory for this command: fewer or smaller pads, points or workers need less.", 1
    if isinstance(error, UnicodeEncodeError):  # for example in the name of a parent folder
        culprit = error.object[max(error.start - 40, 0) : error.end + 40]
        return f"{culprit!a} cannot be written: names in UTF-8, and a locale that has their letters, are needed.", 2
    if isinstance(error, OSError) and error.strerror:
        what = "a file" if error.filename is None else str(error.filename)
        return f"{what} cannot be read or written: {error.strerror} (run with --debug for the traceback)", 1
    return f"{type(error).__name__}: {error} (run with --debug for the traceback)", 1


def _where_to_look(error: click.ClickException) -> str:
    """Hint for a missing or unknown argument on where the arguments are listed; empty for refused values."""
    if not isinstance(error, click.UsageError) or type(error) is click.BadParameter or error.ctx is None:
        return ""
    before = {"--plugin": "FILE.py", "--variant": "NAME"}
    if isinstance(error, click.NoSuchOption) and error.option_name in before:
        option = f"{error.option_name} {before[error.option_name]}"
        return f" (it stands before {error.ctx.info_name}: taxel {option} {error.ctx.info_name} ...)"
    return f" (see {error.ctx.command_path} --help)"


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    click.echo(f"taxel: {' '.join(str(message).split())}", err=True)


def _require_working_directory() -> None:
    """Raise an error if the working directory does not exist: Mitsuba would end the process."""
    try:
        os.getcwd()
    except OSError as error:
        raise click.ClickException(f"the working directory cannot be read: {error.strerror}.") from error


class _Shown(io.TextIOWrapper):
    """Text output in which control characters, such as those in file names, are escaped: a terminal would obey them."""

    def write(self, text: str) -> int:
        return super().write(_CONTROL.sub(lambda match: f"\\x{ord(match[0]):02x}", text))


def _keep_stdout_for_results() -> None:
    """Redirect output of compiled libraries to stderr, so that stdout carries only our own output."""
    encodings = [getattr(stream, "encoding", None) or "utf-8" for stream in (sys.stdout, sys.stderr)]
    for stream in filter(None, (sys.stdout, sys.stderr)):
        stream.flush()
    for number in (0, 1, 2):  # the next opened file would take the number of a closed stream
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    ours, errors = os.dup(1), os.dup(2)
    os.dup2(2, 1)
    # Any file name can be printed.
    results, messages = open(ours, "wb"), open(errors, "wb")
    sys.stdout = _Shown(results, encodings[0], "backslashreplace", line_buffering=os.isatty(ours))
    sys.stderr = _Shown(messages, encodings[1], "backslashreplace", line_buffering=True)


def _stdout_is_full() -> bool:
    """Whether standard output cannot be written; its buffered content is then discarded."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return True
    return False


interrupts.raise_again()
