"""Shipped scenes whose parameters have other names, drawn at random: what a study of them says must be the same.

``python tests/helpers/renamed_scenes.py FIRST COUNT`` compares all shipped scenes with their renamed copies for these
seeds, and prints what differs.
"""

from __future__ import annotations

import json
import random
import re
import sys
import tempfile
from pathlib import Path

import numpy as np

VARIED = {
    "pad.xml": ({"fx": [0, 0.5], "fz": [0, -1, -2]}, {"scattering": "lambertian", "law": "lambertian"}),
    "hexagonal.xml": ({"fz": [0, -1, -2]}, {}),
    "plate.xml": (
        {"offset_x": [-0.5, 0.5], "offset_y": [0.5, 0.0], "z": [0.9, 0.8, 0.7]},
        {"scattering": "lambertian"},
    ),
}
"""For each scene, what is varied, and other values."""
EXPORTED = ("inputs", "units", "low", "high")
"""Metadata of models."""


def renamed(text: str, seed: int) -> tuple[str, dict[str, str]]:
    """The XML of a scene with other names of its parameters, and these by the old ones.

    In scenes with a pad, some parameters that are no force are called as one, or as its time.
    """
    draw, names = random.Random(seed), re.findall(r'<default name="(\w+)"', text)
    dealt = ["fx", "fy", "fz", "time", "history"] if "deformable_pad" in text else []
    new = [*dealt, *(f"name_{number}" for number in range(len(names)))][: max(len(names), len(dealt))]
    draw.shuffle(new)
    table = dict(zip(names, new, strict=False))
    for name, other in table.items():
        text = re.sub(rf'(<default name="|\$){name}\b', rf"\1<{other}>", text)
    return re.sub(r"<(\w+)>(?=\W)", lambda match: match[1] if match[1] in new else match[0], text), table


def said_of(scene: Path, vary: dict, define: dict, folder: Path, **options) -> dict[str, object]:
    """What a study of a scene says: numbers of its tables, and texts of its plots."""
    from mitsuba_taxel import open_study, sweep
    from mitsuba_taxel.characterise import characteristics, sensitivity_table, simulated_experiments
    from mitsuba_taxel.characterise.summary import slope_summary
    from mitsuba_taxel.plots.curves import plot_curves
    from mitsuba_taxel.plots.maps import has_map, plot_map

    sweep(scene, vary, defines=define, points=16, output=folder, **options)
    study = open_study(folder)
    figures = [plot_curves(study), *([plot_map(study)] if has_map(study) else [])]
    found = simulated_experiments(study, None)
    tables = [sensitivity_table(study), slope_summary(study)[1]]
    tables += [characteristics(found.experiments, found.off)] if found.experiments else []
    return {
        "export": _exported(study, folder / "model.onnx"),
        "power": study.power.values,
        "total": study.total_error.values,
        "tables": [table.select_dtypes("number").to_numpy() for table in tables],
        "words": [[str(table[name].tolist()) for name in ("force", "figure") if name in table] for table in tables],
        "labels": [
            [
                [ax.get_xlabel(), ax.get_ylabel(), ax.xaxis_inverted(), *(text.get_text() for text in figure.texts)]
                for ax in figure.axes
            ]
            for figure in figures
        ],
        "lines": [
            [(line.get_xdata(), line.get_ydata()) for ax in figures[0].axes for line in ax.lines],
            [_legend(figure) for figure in figures],
        ],
    }


def _exported(study, file: Path) -> dict[str, object]:
    """What a model of the study says of itself, and its readings in the middle of its inputs' ranges; nothing without
    onnx, or of steps."""
    from importlib.util import find_spec

    if find_spec("onnx") is None:
        return {}
    import onnx
    from onnx.reference import ReferenceEvaluator

    from mitsuba_taxel.surrogates import export

    export(study, file)
    model = onnx.load(file)
    about = {entry.key: json.loads(entry.value) for entry in model.metadata_props if entry.key in EXPORTED}
    middle = (np.array([about["low"]]) + about["high"]) / 2
    said = {name: about[name] for name in ("inputs", "units")}
    return {"said": said, "readings": ReferenceEvaluator(model).run(["readings"], {"inputs": middle})[0]}


def _legend(figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def differences(file: Path, seed: int, folder: Path, **options) -> list[str]:
    """What a study of a renamed scene says otherwise; beside the scene are its files."""
    vary, define = VARIED[file.name]
    text, table = renamed(file.read_text(), seed)
    for each in file.parent.glob(f"{file.stem}.stl"):
        (folder / each.name).write_bytes(each.read_bytes())
    (folder / file.name).write_text(text)
    one = said_of(file, vary, define, folder / "own", **options)
    other = said_of(
        folder / file.name,
        {table[name]: values for name, values in vary.items()},
        {table[name]: value for name, value in define.items()},
        folder / "renamed",
        **options,
    )
    back = {new: old for old, new in table.items()}

    def with_old_names(said: object) -> str:
        return re.sub(
            r"(parameter )?\b(name_\d+|time|history|f[xyz])\b", lambda word: _old(word, back, table), str(said)
        )

    found = []
    for title in one:
        if title in ("power", "total"):
            same = np.allclose(one[title], other[title], rtol=1e-9, equal_nan=True)
        elif title == "export":
            (first, second), words = (said[title].get("readings", 0) for said in (one, other)), other[title].get("said")
            same = np.allclose(first, second, rtol=1e-9) and str(one[title].get("said")) == with_old_names(words)
        elif title == "tables":
            pairs = zip(one[title], other[title], strict=True)
            same = all(np.allclose(*pair, rtol=1e-6, atol=1e-12, equal_nan=True) for pair in pairs)
        elif title == "lines":
            same = all(
                np.allclose(*pair, rtol=1e-6, atol=1e-12)
                for first, second in zip(one[title][0], other[title][0], strict=True)
                for pair in zip(first, second, strict=True)
            ) and str(one[title][1]) == with_old_names(other[title][1])
        else:
            same = str(one[title]) == with_old_names(other[title])
        found += [] if same else [f"{file.name}, seed {seed}: {title}: {one[title]} and {other[title]}"]
    return found


def _old(word: re.Match[str], back: dict[str, str], table: dict[str, str]) -> str:
    """The old name of a new one in words; forces and the time of a load have their own in what studies say."""
    impostor, name = word[1], word[2]
    return name if not impostor and name in ("fx", "fy", "fz", "time") and name in table else back.get(name, name)


def main(first: int, count: int) -> None:
    """Print what differs, of all shipped scenes."""
    from mitsuba_taxel.sensing.scene.finding import shipped_scenes

    for seed in range(first, first + count):
        for file in sorted(shipped_scenes().glob("*.xml")):
            if "phototransistor" not in file.read_text():
                continue  # an image has no table
            with tempfile.TemporaryDirectory() as folder:
                found = differences(file, seed, Path(folder), mesh_size=1.6)
                print(f"{file.name}, seed {seed}: {len(found)} differences", *found, sep="\n", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
