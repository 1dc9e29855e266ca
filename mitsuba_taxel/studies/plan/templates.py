"""Commented templates of scenes, studies, tables of steps, circuits and parts."""

from __future__ import annotations

from pathlib import Path

from mitsuba_taxel.base.arguments import path_of
from mitsuba_taxel.base.atomic import write_text
from mitsuba_taxel.base.errors import InputError
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
"""What the scene with a ball has in place of what that with a force has."""


def write_template(kind: str, file: str | Path) -> None:
    """Write a commented template, which can be used unchanged.

    Parameters
    ----------
    kind : str
        ``scene`` or, with a ball that presses on the pad, ``touch`` (Mitsuba XML), ``study`` (TOML), ``steps``
        (CSV), ``circuit`` or ``part`` (TOML).
    file : str or Path
        New file, with the suffix of its kind: ``.xml``, ``.toml`` or ``.csv``.

    Raises
    ------
    InputError
        if there is no such kind, or the file exists or cannot be written.
    """
    if not isinstance(kind, str) or kind not in SUFFIXES:
        raise InputError(f"kind = {kind!r} is not allowed: one of {', '.join(SUFFIXES)} is needed.")
    file = path_of("file", file)
    check_new_file(file, SUFFIXES[kind])
    if file.exists():
        raise InputError(f"{file} exists: the name of a new file is needed.")
    write_text(file, _text(kind))


def _text(kind: str) -> str:
    if kind == "touch":
        text = _text("scene")
        for force, ball in _TOUCH:
            assert force in text
            text = text.replace(force, ball)
        return text
    return (_FILES / f"{kind}{SUFFIXES[kind]}").read_text(encoding="utf-8")
