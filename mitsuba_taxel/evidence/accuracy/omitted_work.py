"""Time saved by omitting unnecessary work: shipped scenes are measured unchanged, and with the unnecessary work added.

Each row of the table is measured in separate processes: once with empty caches of kernels and solutions, then twice
with the caches of the first run. These processes run this module, with the scene and the added work as JSON.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.processes.system import processor_seconds

# No further imports: a row counts the modules that its scene needs.

SCENES: dict[str, tuple[str, dict[str, object]]] = {
    "plate": ("plate.xml", {}),
    "pad": ("pad.xml", {}),
    "pad-10": ("pad.xml", {"fz": -10}),
    "hexagonal": ("hexagonal.xml", {}),
}
POINTS = 256
SMALLEST_KERNEL = 100
"""Least number of operations of a counted kernel. Smaller kernels only read values, and their number varies."""
HEAVY = ("matplotlib", "meshio", "netgen", "pandas", "pytetwild", "rslab", "scipy", "trimesh", "xarray")
AS_IS, ALL = "as it is", "all of these"
HEADINGS = ("scene", "added work", "modules", "slow ones", "triangles", "unknowns", "kernels", "operations",
            "first CPU s", "again CPU s", "Z")  # fmt: skip


def _import_everything() -> None:
    import pkgutil
    from importlib import import_module

    import mitsuba_taxel

    for name in HEAVY:
        if name != "pytetwild":  # only the mesher's own process can import it
            import_module(name)
    for room in pkgutil.walk_packages(mitsuba_taxel.__path__, "mitsuba_taxel."):
        skipped = ("mitsuba_taxel.plugins", "mitsuba_taxel.cli", "mitsuba_taxel.pads.imported.worker")
        if not room.name.startswith(skipped):
            import_module(room.name)


def _solve_the_whole_pad() -> None:
    from mitsuba_taxel.mechanics.continuation.pad_path import PadPath

    changed: Any = PadPath
    changed.images = property(lambda path: {})


def _solve_without_load() -> None:
    """Added work (usually omitted): solve pads that have no load, and compute the effect of their error, which is 0, on
    the readings."""
    import numpy as np

    from mitsuba_taxel.mechanics.continuation.pad_path import PadPath
    from mitsuba_taxel.sensing import targets
    from mitsuba_taxel.sensing.reading import mechanics_error
    from mitsuba_taxel.sensing.scene import scene_pads

    state = PadPath.state

    def solved(path: PadPath, value: np.ndarray, obstacles: np.ndarray | None = None):
        direction = np.eye(len(value))[-1]
        pad = path.segments.pad_for(0 * direction, direction)
        pad.solve(np.zeros(pad.unknowns), value)
        return state(path, value, obstacles)

    changed: Any = PadPath
    changed.state = solved
    targets.loaded_pads = mechanics_error.loaded_pads = scene_pads.deformed_pads


def _cut_everything_finely() -> None:
    from dataclasses import replace

    import numpy as np

    from mitsuba_taxel.mechanics.surface import tessellation as surface
    from mitsuba_taxel.pads import REGIONS

    cut = surface.cut_faces

    def longest(mesh, faces) -> float:
        corners = mesh.points[faces[:, :3]]
        return float(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max())

    def finely(mesh, subdivision, cells=None):
        """Replacement for the subdivision of faces: all faces of a mesh are subdivided as finely as those of the cells.
        """
        ratio = longest(mesh, mesh.faces) / longest(mesh, mesh.faces[mesh.face_cell > 0])
        side = np.full_like(mesh.face_region, REGIONS["side"])
        return cut(replace(mesh, face_region=side), int(np.ceil(subdivision * ratio)))

    surface.cut_faces = finely


def _only_asked_for() -> None:
    """Does nothing: this kind of added work is requested by the arguments of the reading in :func:`row`."""


ALL_THE_SAME: dict[str, Callable[[], None]] = {
    "everything imported": _import_everything,
    "three channels traced": _only_asked_for,
    "whole pad solved": _solve_the_whole_pad,
    "unloaded pad solved": _solve_without_load,
    "all of the surface cut finely": _cut_everything_finely,
    "irradiance map accumulated": _only_asked_for,
    "all pairs traced": _only_asked_for,
}
OF_ANY = ("everything imported", "three channels traced", "irradiance map accumulated")
"""Work that can be added to a scene without a pad."""


def additions(scene: str) -> list[list[str]]:
    """The work that is added in each row of the table for a scene, by name: first none, then each possible kind, then
    all kinds.
    """
    file, values = SCENES[scene]
    loaded = any(values.values())
    possible = [
        name
        for name in ALL_THE_SAME
        if (file != "plate.xml" or name in OF_ANY)
        and name != ("unloaded pad solved" if loaded else "whole pad solved")
        and (file == "pad.xml" or name != "all pairs traced")  # crosstalk takes one array
    ]
    return [[], *([name] for name in possible), possible]


def row(scene: str, added: list[str]) -> dict:
    """Read a scene in this process with work that is usually omitted, and count what this takes: imported modules,
    triangles, unknowns and kernels.

    Parameters
    ----------
    scene : str
        Name from :data:`SCENES`.
    added : list[str]
        Names of the added work, from :data:`ALL_THE_SAME`.
    """
    from mitsuba_taxel.sensing import Scene  # before anything imports mitsuba: it chooses the LLVM

    # isort: split
    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb" if "three channels traced" in added else "llvm_ad_mono")
    dr.set_flag(dr.JitFlag.KernelHistory, True)
    dr.set_thread_count(1)  # waiting threads take time too
    from mitsuba_taxel.sensing import crosstalk, measure
    from mitsuba_taxel.sensing.reading.runs import prepare

    for name in added:
        ALL_THE_SAME[name]()
    file, values = SCENES[scene]
    ready = prepare(Scene.from_file(file, **values))
    readings = measure(ready, points=POINTS, irradiance="irradiance map accumulated" in added)
    power, error = readings.power, readings.standard_error
    if "all pairs traced" in added:
        matrix = crosstalk(ready, points=POINTS)
        power, error = matrix.power.diagonal(), matrix.standard_error.diagonal()
    sizes = {kernel["hash"]: kernel["operation_count"] for kernel in dr.kernel_history([dr.KernelType.JIT])}
    kernels = [size for size in sizes.values() if size >= SMALLEST_KERNEL]
    modules = set(sys.modules)
    return {
        "modules": len(modules),
        "heavy": [name for name in HEAVY if name in modules],
        "triangles": sum(s.face_count() for s in ready.scene.shapes() if s.is_mesh() and s.class_name() != "Rectangle"),
        "unknowns": _unknowns(),
        "kernels": len(kernels),
        "operations": sum(kernels),
        "power": power.tolist(),
        "error": error.tolist(),
    }


def _unknowns() -> int:
    """Number of unknowns of the largest system of equations that was solved; 0 if none was."""
    import gc

    pads = [candidate for candidate in gc.get_objects() if type(candidate).__name__ == "LoadedPad"]
    return max((pad.unknowns for pad in pads if "_pattern" in vars(pad.model.assembly)), default=0)


def with_seconds(scene: str, added: list[str]) -> dict:
    """Result of :func:`row` from a first run with empty caches, with the CPU seconds of this run and the smaller CPU
    seconds of two later runs.

    Parameters
    ----------
    scene : str
        Name from :data:`SCENES`.
    added : list[str]
        Names of the added work, from :data:`ALL_THE_SAME`.
    """
    with tempfile.TemporaryDirectory() as folder:
        caches = {"HOME": folder, "MITSUBA_TAXEL_CACHE": str(Path(folder) / "solutions")}
        figures, seconds = _run(scene, added, caches)
        return figures | {"seconds": [seconds, min(_run(scene, added, caches)[1] for _ in range(2))]}


def _run(scene: str, added: list[str], caches: dict[str, str]) -> tuple[dict, float]:
    start = processor_seconds(children_only=True)
    command = [sys.executable, "-m", "mitsuba_taxel.evidence.accuracy.omitted_work", json.dumps([scene, added])]
    process = subprocess.run(command, env=os.environ | caches, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(process.stdout), processor_seconds(children_only=True) - start


def table(scenes: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Measure all rows of the table, and yield each as text cells in the order of :data:`HEADINGS`.

    Parameters
    ----------
    scenes : sequence of str
        Names from :data:`SCENES`; all if empty.

    Raises
    ------
    InputError
        if a name is unknown.
    """
    from mitsuba_taxel.base.arguments import refusal

    for name in scenes:
        if name not in SCENES:
            raise refusal("scene", name, f"one of {', '.join(SCENES)} is needed")
    for scene in scenes or SCENES:
        first = None
        for added in additions(scene):
            figures = with_seconds(scene, added)
            first = first or figures
            file, values = SCENES[scene]
            name = ", ".join([file, *(f"{key} = {value}" for key, value in values.items())])
            work = AS_IS if not added else ALL if len(added) > 1 else added[0]
            yield (
                name,
                work,
                str(figures["modules"]),
                ", ".join(figures["heavy"]) or "-",
                str(figures["triangles"]),
                str(figures["unknowns"]),
                str(figures["kernels"]),
                str(figures["operations"]),
                *(f"{seconds:.1f}" for seconds in figures["seconds"]),
                "-" if figures is first else f"{_deviation(first, figures):.2f}",
            )


def _deviation(first: dict, second: dict) -> float:
    """Largest difference between the readings of two runs, divided by their combined standard error."""
    columns = zip(first["power"], second["power"], first["error"], second["error"], strict=True)
    return max(abs(b - a) / (e**2 + f**2) ** 0.5 for a, b, e, f in columns)


PAGE = """\
# Savings from omitted work

For users who ask what makes a scene slow, and for people who change the code.

Written by `taxel bench omitted-work --markdown docs/omitted_work.md`; do not edit by hand.
`taxel render SCENE --explain` lists the work that is omitted for a scene.

Each row is a reading with {points} points in 32 randomisations. The first row of a scene is the unchanged scene; each
following row adds one piece of work that the scene does not need; the last row adds all of them.

{table}

- **added work**: *whole pad solved*: usually, only one of the parts that are mirror images is solved. *Unloaded pad
  solved*: the equilibrium of a pad at rest is computed. *All pairs traced*: light is traced from every LED to every
  phototransistor, as for crosstalk; usually, it is traced within each taxel.
- **modules**, **slow ones**: number of imported Python modules, and which packages among them are slow to import
  (`rslab` solves systems of equations).
- **triangles**: number of triangles in which light is traced.
- **unknowns**: number of unknowns of the largest system of equations that is solved; 0 for none.
- **kernels**, **operations**: number of different kernels of {smallest} operations or more that Dr.Jit ran, and the
  total number of operations of their intermediate representation.
- **first CPU s**: CPU time of the whole process, with empty caches of kernels and solutions; one thread traces the
  light. **again CPU s**: the smaller CPU time of two runs with the caches of the first run. Rows of equal work differ
  by up to a third if the machine is busy. The added solution of an unloaded pad is not cached.
- **Z**: difference of a reading from the same reading in the first row, divided by the standard error of this
  difference due to the light; the largest over all readings. The random numbers are the same, so it is 0 or small. They
  differ only if all pairs are traced: there, a Z of one or two is expected.

Some work is omitted in every scene, so that no row can show what it would cost. Paths end at absorbing walls. Under a
plate or an unloaded flat roof, all reflecting surfaces lie in one plane, and no path is reflected twice: `max_depth`
= 1 gives bitwise the same readings. In colour variants, `taxel_tracer` traces the first of the three channels only.
"""


def page(rows: Sequence[tuple[str, ...]]) -> str:
    """Write the table as a Markdown page."""
    from mitsuba_taxel.base.files.markdown import markdown_table

    table = markdown_table(HEADINGS, rows, ("scene", "added work", "slow ones"))
    return PAGE.format(points=POINTS, smallest=SMALLEST_KERNEL, table=table)


if __name__ == "__main__":
    print(json.dumps(row(*json.loads(sys.argv[1]))))
