"""Scenes of random parts with random values of all their parameters: common ones, extremes, and wrong types.

``python tests/helpers/random_scenes.py FIRST COUNT`` reads and checks the scenes of these seeds in a process of its
own, and prints what came of each that is odd, and a summary. A scene depends on its seed alone.
"""

from __future__ import annotations

import json
import os
import random
import resource
import select
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

SECONDS = 120.0
"""On the clock, after which a scene has no end; twice what one may take, as other processes may run."""
MEMORY = 8 * 2**30
EXTREMES = ("0", "-1", "1e-9", "1e-3", "0.01", "20", "1000", "1e9", "1e18", "1e300", "nan", "inf", "-0.0")
WRONG = ("", "abc", "true", "1 2", "0, 0, 1", "none", "1.5", "é", "../x", "a" * 300)
TAGS = {"float": "float", "int": "integer", "boolean": "boolean", "string": "string", "vector": "vector"}
SELDOM = (
    "rows", "columns", "mesh_size", "mesh_tolerance", "subdivision", "finish", "roof_finish", "side_finish", "part",
    "filename", "regions", "spacing",
    "body", "led_shift", "phototransistor_shift", "indenter_file", "pitch", "shore_a", "window_height",
)  # fmt: skip
"""Parameters that take minutes, exclude others, or fit few others: given in wild scenes alone."""
WORDS = {
    "prony": "0.2 1; 0.1 10", "history": "1 0 0 -0.1", "profile": "1.3 0; 1.3 0.8; 0.9 1.3; 0 1.4", "read_cells": "1",
    "mullins": "2 0.02 0.1", "markers": "2 2 0.25", "file": "table.csv", "reflectance_table": "walls.csv",
}  # fmt: skip
SHARES = ("specular", "lambertian", "isotropic")


def random_scene(seed: int) -> str:
    """The XML of a scene."""
    draw = random.Random(seed)
    rows, columns = draw.choice([(1, 1), (1, 1), (1, 1), (1, 2)])
    array = {"rows": str(rows), "columns": str(columns)}
    wild = draw.choice([0.0, 0.0, 0.0, 0.03, 0.1])  # share of values that are extreme or wrong
    parts = []
    kind = draw.choice(["taxel_tracer", "taxel_tracer", "taxel_tracer", "", "taxel_path", "analog_tracer"])
    if kind:
        parts.append(_part(draw, "integrator", kind, {}, wild))
    if draw.random() < 0.6:
        size = {"mesh_size": draw.choice(["1.5", "2", "3"]), **array}
        walls = "".join(
            _part(draw, "bsdf", "wall", {}, wild, name)
            for name in ("roof", "side", "bottom", "outer")
            if name == "roof" or draw.random() < 0.4
        )
        parts.append(_part(draw, "shape", "deformable_pad", size, wild, inner=f'<bsdf type="region">{walls}</bsdf>'))
    if draw.random() < 0.6 or len(parts) < 2:
        place = draw.choice(["1", "3", "6", "20", *EXTREMES] if draw.random() < wild else ["1.2", "2", "4", "6"])
        turn = f'<rotate x="1" angle="180"/> <scale value="{draw.choice([1, 3, 10])}"/> <translate z="{place}"/>'
        plate = f'<transform name="to_world"> {turn} </transform> {_part(draw, "bsdf", "wall", {}, wild)}'
        parts.append(f'<shape type="rectangle"> {plate} </shape>')
    ends = _part(draw, "emitter", "annular_led", {}, wild) + _part(draw, "sensor", "phototransistor", {}, wild)
    parts.append(_part(draw, "shape", "photo_reflector", array, wild, inner=ends))
    return '<scene version="3.9.0">\n' + "\n".join(parts) + "\n</scene>\n"


def _part(
    draw: random.Random, tag: str, plugin: str, given: dict[str, str], wild: float, name: str = "", inner: str = ""
) -> str:
    """The element of a plugin, with some of its parameters, those that apply as a rule, and the nested ones."""
    from mitsuba_taxel.parameters import Choice
    from mitsuba_taxel.specification import specifications

    parameters = specifications()[plugin].values()
    words = dict(given)
    choices = [each for each in parameters.values() if isinstance(each, Choice)]
    others = [each for each in parameters.values() if not isinstance(each, Choice)]
    for parameter in (*choices, *others):
        applies = not parameter.when or _chosen(parameters, words, parameter.when[0]) in parameter.when[1:]
        usual = 0.6 if parameter.default is ... else 0.35 if isinstance(parameter, Choice) else 0.15
        if parameter.name in words or parameter.type not in TAGS or (parameter.name in SELDOM and draw.random() > wild):
            continue
        if (
            any(name in words for name in parameter.excluded) or (parameter.needs and parameter.needs not in words)
        ) and draw.random() > wild:
            continue
        if parameter.name in SHARES and applies and draw.random() >= wild:
            words[parameter.name] = str({"specular": 0.25, "lambertian": 0.5, "isotropic": 0.25}[parameter.name])
            continue
        if draw.random() < (usual if applies else 0.1 * wild) or (applies and parameter.default is ...):
            words[parameter.name] = _value(draw, parameter, wild)
    elements = "".join(
        f'<{TAGS[parameters[key].type]} name="{key}" value={quoteattr(word)}/>\n' for key, word in words.items()
    )
    named = f' name="{name}"' if name else ""
    return f'<{tag} type="{plugin}"{named}>\n{elements}{inner}</{tag}>\n'


def _chosen(parameters: dict[str, Any], words: dict[str, str], name: str) -> Any:
    """The value of a choice, given or not; None if it does not apply."""
    if name in words or name not in parameters:
        return words.get(name)
    own = parameters[name]
    applies = not own.when or _chosen(parameters, words, own.when[0]) in own.when[1:]
    return own.default if applies else None


def _value(draw: random.Random, parameter: Any, wild: float) -> str:
    """A value of a parameter, as text."""
    from mitsuba_taxel.parameters import Choice, Number, Switch, Vector, Whole

    if draw.random() < wild:
        word = draw.choice(WRONG if draw.random() < 0.3 else EXTREMES)
        return ", ".join([word] * 3) if isinstance(parameter, Vector) and draw.random() < 0.7 else word
    if isinstance(parameter, Choice):
        unknown = ("white_silicone", "black_silicone", "white_plastic", "white_paint", "black_print")  # without data
        return draw.choice([word for word in parameter.allowed if word not in unknown])
    if isinstance(parameter, Switch):
        return draw.choice(["true", "false"])
    if isinstance(parameter, Whole):
        return str(draw.randint(parameter.minimum, min(parameter.maximum, parameter.minimum + 8)))
    if isinstance(parameter, Vector):
        if parameter.name == "force":
            return f"{draw.choice([0, 0, 0.1]):g}, 0, {draw.choice([0, -0.01, -0.1, -1]):g}"
        if parameter.name == "displacement":
            return f"{draw.choice([0, 0, 0.1]):g}, 0, {draw.choice([0, -0.01, -0.1, -0.3]):g}"
        usual = parameter.default if isinstance(parameter.default, tuple) else (0.0, 0.0, 0.0)
        return ", ".join(f"{(number or draw.choice([0, 0.05])) * draw.uniform(0.8, 1.2):.4g}" for number in usual)
    if isinstance(parameter, Number):
        default = parameter.default
        if isinstance(default, (int, float)) and default:
            value = default * draw.uniform(0.7, 1.3)
        elif default == 0 and parameter.unit in ("mm", "degrees", "s"):
            value = draw.choice([0, 0.02, 0.1])
        else:
            above = max(parameter.minimum, parameter.above, 0.01)
            least, most = parameter.common or (above, min(parameter.maximum, 2.0))
            value = draw.uniform(least, min(most, 10 * least + 2))
        return f"{min(max(value, parameter.minimum), parameter.maximum):.4g}"
    return WORDS.get(parameter.name, draw.choice(["table.csv", "x", ""]))


def outcome_of(path: Path) -> dict[str, Any]:
    """What came of reading and of checking a scene."""
    import numpy as np

    from mitsuba_taxel import ComputationError, InputError, Scene, check_scene, measure

    began, about = time.process_time(), {}
    try:
        scene = Scene.from_file(path)
        readings = measure(scene, points=16)
        emitted = max(float(np.max(emitter.power)) for emitter in scene.load().emitters() if hasattr(emitter, "power"))
        lit = float(np.nanmax(readings.power, initial=0.0))
        error = float(np.nanmax(readings.standard_error, initial=0.0))
        finite = bool(np.isfinite(readings.replicates).all() and (readings.power >= 0).all())
        about = {"kind": "reading" if finite else "not finite", "power": lit, "error": error, "emitted": emitted}
    except (InputError, ComputationError) as refused:
        about = {"kind": "refused" if isinstance(refused, InputError) else "stopped", "message": str(refused)}
    except Exception as failure:
        about = {"kind": f"raw {type(failure).__name__}", "message": str(failure)[:300]}
    try:
        errors = [finding.message for finding in check_scene(path) if finding.severity == "error"]
    except (InputError, ComputationError) as refused:
        errors = [str(refused)]
    except Exception as failure:
        about |= {"kind": f"raw {type(failure).__name__} in check", "message": str(failure)[:300]}
        errors = []
    if about["kind"] in ("reading", "refused", "stopped") and (about["kind"] == "reading") is bool(errors):
        about |= {"disagrees": about["kind"], "check": errors[:2], "kind": "disagreement"}
    return {**about, "seconds": time.process_time() - began}


class Reader:
    """A process that reads scenes, and is begun anew when it has ended or has no end."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.process = folder, None
        (folder / "table.csv").write_text("0, 1\n45, 0.7\n90, 0\n")
        (folder / "walls.csv").write_text("800, 0.7\n1000, 0.9\n")

    def outcome(self, seed: int) -> dict[str, Any]:
        file = self.folder / "scene.xml"
        file.write_text(random_scene(seed), encoding="utf-8")
        if self.process is None:
            command = [sys.executable, __file__, "worker"]
            environment = {**os.environ, "MITSUBA_TAXEL_CACHE": str(self.folder / "solutions")}
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
            )
        self.process.stdin.write(f"{file}\n".encode())
        self.process.stdin.flush()
        if not select.select([self.process.stdout], [], [], SECONDS)[0]:
            self.end()
            return {"kind": "no end", "seconds": SECONDS}
        line = self.process.stdout.readline()
        if line:
            return json.loads(line)
        code = self.process.wait()
        self.end()
        return {"kind": "death", "message": f"the process ended with {code}", "seconds": 0.0}

    def end(self) -> None:
        if self.process is not None:
            with self.process as process:
                process.kill()
            self.process = None


def work() -> None:
    """Answer names of files by outcomes, in JSON."""
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    warnings.simplefilter("ignore")
    for line in sys.stdin:
        print(json.dumps(outcome_of(Path(line.strip()))), file=answers, flush=True)


def main(first: int, count: int) -> None:
    """Print what comes of some scenes."""
    kinds, longest, lit = Counter(), (0.0, 0), 0
    with tempfile.TemporaryDirectory() as folder:
        reader = Reader(Path(folder))
        for seed in range(first, first + count):
            about = reader.outcome(seed)
            kinds[about["kind"]] += 1
            lit += about["kind"] == "reading" and about["power"] > 0 and about["error"] > 0
            longest = max(longest, (about["seconds"], seed))
            if about["kind"] not in ("reading", "refused", "stopped"):
                print(seed, json.dumps(about), flush=True)
        reader.end()
    print(f"{dict(kinds)}; {lit} readings with light and error; longest {longest[0]:.1f} CPU s (seed {longest[1]})")


if __name__ == "__main__":
    work() if sys.argv[1] == "worker" else main(int(sys.argv[1]), int(sys.argv[2]))
