"""Commented templates of scenes, studies, tables of steps, circuits and parts."""

from __future__ import annotations

import re
from pathlib import Path

from mitsuba_taxel.base.arguments import path_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.parts import Part, circuit_of_part, read_part
from mitsuba_taxel.parts.part_circuit import OPTIONAL
from mitsuba_taxel.studies.plan.files import check_new_file

SUFFIXES = {"scene": ".xml", "touch": ".xml", "study": ".toml", "steps": ".csv", "circuit": ".toml", "part": ".toml"}

_FILES = Path(__file__).with_name("template_files")

_TOUCH = (
    (
        """on photo-reflectors, under a force. Lengths in mm, forces in N, powers in W.
     taxel render scene.xml                  what each phototransistor reads
     taxel render scene.xml -D fz=-10        the same with another value of a default
""",
        """on photo-reflectors, pressed by a ball. Lengths in mm, forces in N, powers in W.
     taxel render touch.xml                          what each phototransistor reads
     taxel render touch.xml -D indenter=punch        the same with another value of a default
     taxel picture touch.xml                         pad, ball and what it presses with
     For a map of readings, let taxel sweep vary indenter_x and indenter_y.
""",
    ),
    (
        """    <!-- Load: total force on the top of the pad, in N; compression is fz below 0. -->
    <default name="fx" value="0"/>
    <default name="fy" value="0"/>
    <default name="fz" value="-5"/>
""",
        """    <!-- Load: a rigid body, pushed down from where it just touches the top. -->
    <default name="indenter" value="sphere"/>            <!-- sphere, punch, cylinder -->
    <default name="indenter_radius" value="2.5"/>        <!-- mm -->
    <default name="indenter_x" value="0"/>               <!-- mm, from the centre of the pad -->
    <default name="indenter_y" value="0"/>               <!-- mm -->
    <default name="indenter_depth" value="0.5"/>         <!-- mm -->
""",
    ),
    (
        """        <vector name="force" value="$fx, $fy, $fz"/>
""",
        """        <!-- Or by force, in N: load "indenter_force" and <vector name="force" value="0, 0, -2"/> -->
        <string name="load" value="indenter_displacement"/>
        <vector name="displacement" value="0, 0, -$indenter_depth"/>
        <string name="indenter" value="$indenter"/>
        <float name="indenter_radius" value="$indenter_radius"/>
        <float name="indenter_x" value="$indenter_x"/>
        <float name="indenter_y" value="$indenter_y"/>
""",
    ),
)
"""Pairs of texts that make the template of a scene with a ball from that with a force: replaced text, replacement."""


def write_template(kind: str, file: str | Path, part: str | Path | None = None) -> None:
    """Write a commented template, which can be used unchanged.

    Parameters
    ----------
    kind : str
        ``scene`` or, with a ball that presses on the pad, ``touch`` (Mitsuba XML), ``study`` (TOML), ``steps``
        (CSV), ``circuit`` or ``part`` (TOML).
    file : str or Path
        New file, with the suffix of its kind: ``.xml``, ``.toml`` or ``.csv``.
    part : str or Path, optional
        For a circuit: the part whose datasheet gives its numbers (`circuit_of_part`), by name or as a TOML file.

    Raises
    ------
    InputError
        if there is no such kind, the file exists or cannot be written, or the part is not known or states too little.
    """
    if not isinstance(kind, str) or kind not in SUFFIXES:
        raise InputError(f"kind = {kind!r} is not allowed: one of {', '.join(SUFFIXES)} is needed.")
    file = path_of("file", file)
    if part is not None and kind != "circuit":
        raise InputError(
            f"part = {str(part)!r} is not allowed: only the template of a circuit takes a part, not "
            f"that of a {kind}; leave it out."
        )
    text = _text(kind) if part is None else _circuit_text(read_part(part))
    check_new_file(file, SUFFIXES[kind])
    if file.exists():
        raise InputError(f"{file} exists: the name of a new file is needed.")
    write_text(file, text)


def _text(kind: str) -> str:
    if kind == "touch":
        text = _text("scene")
        for force, ball in _TOUCH:
            assert force in text
            text = text.replace(force, ball)
        return text
    return (_FILES / f"{kind}{SUFFIXES[kind]}").read_text(encoding="utf-8")


def _circuit_text(part: Part) -> str:
    """The template of a circuit with the numbers of a part; lines of numbers that its datasheet lacks are comments."""
    circuit = circuit_of_part(part).as_table()
    figures = part.electrical
    typical = figures["collector_current_typical_A"]
    spread = [f"{figures[name] / typical:.2g}" for name in _SPREAD if name in figures]
    between = f", from part to part {' to '.join(spread)} times that" if spread else ""
    condition = f"under a {part.distance_reflector} at {figures['collector_distance_mm']:g} mm"
    about = {
        "load_resistance": "Ohm, from the emitter to ground; weaker light may need more",
        "transfer": f"A/W: {typical:g} A {condition}{between}",
        "led_efficiency": "W/A, assumed; its product with transfer is what the part states",
    }

    # Lines of the template: values of the part with their origin as comment, lines without a value as comments.
    unknown = {*OPTIONAL.values(), "led_drift"} - {ours for name, ours in OPTIONAL.items() if name in figures}
    head = f"# {part.name}: {part.title}\n# {part.source}; what the part does not state is an example.\n"
    lines = []
    for line in _text("circuit").splitlines():
        match = re.match(r"(?P<name>\w+) = \S+ *(?P<comment># .*)?", line)
        name = match["name"] if match else ""
        if match and name in unknown:
            line = f"# {line}"
        elif match and name in (*about, "led_current", *OPTIONAL.values()):
            comment = f"# {about[name]}" if name in about else match["comment"]
            line = f"{f'{name} = {circuit[name]:g}':<28}{comment}"
        lines.append(line)
    return head + "\n".join(lines).replace(", with example values: replace them by your parts'", "") + "\n"


_SPREAD = ("collector_current_least_A", "collector_current_most_A")
