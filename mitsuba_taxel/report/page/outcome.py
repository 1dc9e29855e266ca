"""Sections of a page with the output of `taxel tolerance`, `fit`, `optimise`, `compare`, `dataset`, `export` or
`calibrate`."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from html import escape
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from mitsuba_taxel.base.files.printed import Printed, read_printed
from mitsuba_taxel.fitting.wording import UNKNOWN_HEADINGS, unknown_rows
from mitsuba_taxel.report.page.markup import bullets, folded, paragraph, plot, section, table
from mitsuba_taxel.report.page.model_plot import plot_model
from mitsuba_taxel.studies.run.training import PARTS
from mitsuba_taxel.studies.store.datasheet import rows_line
from mitsuba_taxel.surrogates import onnx_model
from mitsuba_taxel.tolerances.wording import INDICES, SPREAD_HEADINGS, SPREADS, index_rows, spread_rows

if TYPE_CHECKING:
    import pandas

MOST_ROWS, MOST_COLUMNS = 50, 12
"""Largest numbers of rows and columns of a table on the page; the file contains all rows and columns."""


MODEL = "Readings against each input, with the other inputs in the middle of their ranges."


class CommandOutput(NamedTuple):
    """Names and captions of the output files of a command such as `taxel fit`, from which a web page is made.

    Attributes
    ----------
    file : str
        Name of the file that identifies the command.
    title : str
        Title of the section.
    verdict : str
        Name of the file with the verdict in lines of text.
    plots, tables : dict[str, str]
        Captions, by file name without suffix.
    """

    file: str
    title: str
    verdict: str
    plots: dict[str, str]
    tables: dict[str, str]


OUTCOMES = (
    CommandOutput(
        "spread.csv",
        "Tolerances",
        "notes.txt",
        {"tolerance": "Spreads of the figures, and the parameters that cause them."},
        {
            "spread": SPREADS,
            "parameters": INDICES,
            "shares": "Linear estimate: contributions of the parameters",
            "samples": "Samples",
        },
    ),
    CommandOutput(
        "fit.csv",
        "Fit",
        "notes.txt",
        {"fit": "Residuals of the fit."},
        {"fit": "Unknowns, with one standard deviation", "correlation": "Correlation", "residuals": "Residuals"},
    ),
    CommandOutput(
        "comparison.csv",
        "Comparison",
        "notes.txt",
        {"comparison": "Figures of merit of the variants, with their errors."},
        {"comparison": "Variants by rank", "volts": "Output of the circuit"},
    ),
    CommandOutput(
        "train.csv",
        "Training set",
        "README.md",
        {},
        {"train": "Training", "validation": "Validation", "test": "Test"},
    ),
    CommandOutput(
        "optimum.md",
        "Optimum",
        "optimum.md",
        {
            "optimum": "Progress of the search; figures and variables before and after.",
            "section": "Section of the pad before and after.",
            "front": "Trade-off of two objectives.",
        },
        {
            "figures": "Figures of merit before and after",
            "variables": "Variables",
            "slopes": "Change around the best design",
            "front": "Trade-offs",
            "history": "Designs",
        },
    ),
)


_Rows = Callable[["pandas.DataFrame"], tuple[Sequence[str], list[tuple[str, ...]]]]
AS_PRINTED: dict[str, tuple[str, _Rows]] = {
    "spread.csv": (SPREADS, lambda table: (SPREAD_HEADINGS, spread_rows(table))),
    "parameters.csv": (INDICES, index_rows),
    "fit.csv": ("Unknowns, with one standard deviation", lambda table: (UNKNOWN_HEADINGS, unknown_rows(table))),
}
"""Tables that the page shows as the command prints them, by the file with their numbers."""


def outcome_sections(folder: Path) -> list[str]:
    """HTML sections with the output of the commands named above; empty if the folder contains no such output."""
    made = [_section(kind, folder) for kind in OUTCOMES if (folder / kind.file).is_file()]
    models = sorted(folder.glob("*.onnx"))
    if models and find_spec("onnx") is None:
        return [*made, section("models", "Models", paragraph("To show them: pip install onnx."))]
    for number, file in enumerate(models):
        if (printed := onnx_model.read_printed(file)) is not None:
            model = onnx_model.read_polynomial(file)
            shown = "" if model is None else plot(partial(plot_model, model), MODEL, MODEL)
            made.append(section(f"model-{number}", f"Model {file.name}", *_printed(printed), shown))
    return made


def _printed(printed: Printed) -> list[str]:
    """HTML of tables and lines that the command prints."""
    html: list[str] = []
    for are_lines, blocks in groupby(printed, lambda block: isinstance(block, str)):
        if are_lines:
            html.append(bullets([str(block) for block in blocks]))
        else:
            html += [table(block.title.removesuffix(":"), *block[1:]) for block in blocks if not isinstance(block, str)]
    return html


def _section(kind: CommandOutput, folder: Path) -> str:
    printed = read_printed(folder)
    blocks = [bullets(_lines(folder / kind.verdict))] if printed is None else _printed(printed)
    if kind.file == "train.csv":
        files = {subset: folder / f"{subset}.csv" for subset in PARTS}
        counts = {subset: _count(file) for subset, file in files.items() if file.is_file()}
        blocks.insert(0, paragraph(rows_line(counts)))
    for name, caption in kind.plots.items():
        kinds = {folder / f"{name}.svg": "svg+xml", folder / f"{name}.png": "png"}
        for file, of in [(file, of) for file, of in kinds.items() if file.is_file()][:1]:
            picture = base64.b64encode(file.read_bytes()).decode("ascii")
            blocks.append(
                f'<figure><img class="plot" src="data:image/{of};base64,{picture}" alt="{escape(caption)}">'
                f"<figcaption>{escape(caption)}</figcaption></figure>"
            )
    for number, (name, caption) in enumerate(kind.tables.items()):
        if (file := folder / f"{name}.csv").is_file():
            made = _table(file, caption)
            is_open = number < 2 and printed is None and kind.file != "train.csv"  # the table has many similar rows
            blocks.append(made if is_open else folded(caption, made))
    return section(kind.title.lower(), kind.title, *blocks)


def _count(file: Path) -> int:
    """Number of rows of a table in a CSV file, without its heading."""
    with file.open("rb") as lines:
        return sum(1 for _ in lines) - 1


def _lines(file: Path) -> list[str]:
    """Lines of the verdict in an output file: all lines of a text file, or the items of the first list of a Markdown
    page."""
    if not file.is_file():
        return []
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    if file.suffix == ".md":
        return [line.removeprefix("- ") for line in lines if line.startswith("- ")]
    return [line for line in lines if line.strip()]


def _table(file: Path, caption: str) -> str:
    import pandas

    content = pandas.read_csv(file)
    if file.name in AS_PRINTED:
        words, made = AS_PRINTED[file.name]
        with suppress(AttributeError, KeyError):  # columns of another version are shown as they are
            return table(f"{words} (all columns in {file.name})", *made(content))
    rows = [
        ["" if value != value else f"{value:.4g}" if isinstance(value, float) else str(value) for value in row]
        for row in content.iloc[:MOST_ROWS, :MOST_COLUMNS].to_numpy(dtype=object).tolist()
    ]
    more = [f"{len(content) - MOST_ROWS} more rows"] if len(content) > MOST_ROWS else []
    more += [f"{content.shape[1] - MOST_COLUMNS} more columns"] if content.shape[1] > MOST_COLUMNS else []
    caption += f" ({' and '.join(more)} in {file.name})" if more else ""
    headings = [str(name) for name in content.columns[:MOST_COLUMNS]]
    if file.name == "correlation.csv":  # a correlation of parameters with each other: the first column has no name
        headings[0] = ""
    else:
        headings = [heading.replace("_", " ") for heading in headings]
    return table(caption, headings, rows)
