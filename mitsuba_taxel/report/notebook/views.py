"""HTML views of the package's objects: drawings, tables and plots, in the colours of the notebook."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.sensing.reading.readings import light_error_line, readings_columns
from mitsuba_taxel.sensing.reading.wording import budget_line

if TYPE_CHECKING:
    import pandas
    import xarray as xr

    from mitsuba_taxel.mechanics import Material, Mullins, Viscoelastic
    from mitsuba_taxel.mechanics.continuation.state import State
    from mitsuba_taxel.mechanics.materials.silicones import Silicone
    from mitsuba_taxel.pads import Block, Pad, PadFile
    from mitsuba_taxel.sensing import PadSensor, Readings, Scene

MOST_LINES = 10
"""Largest number of shown failures of a study, and of rows at either end of a table."""
MOST_DRAWN = 5000
"""Largest number of readings that are plotted as SVG; files of larger plots would be too large."""


@dataclass(frozen=True, eq=False)
class StudyView:
    """View of a study, returned by :func:`show`."""

    study: xr.Dataset | xr.DataTree

    def _repr_html_(self) -> str:
        import xarray as xr

        if isinstance(self.study, xr.Dataset):
            return _study(self.study, str(self.study.attrs["scene"]))
        return "".join(_study(leaf.to_dataset(), str(leaf.name)) for leaf in self.study.leaves)


def show(study: xr.Dataset | xr.DataTree) -> StudyView:
    """Show a study in a notebook: plot of the readings, sensitivities, figures of the circuit, and error budget.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        Result of ``sweep``, ``run_study`` or ``open_study``.

    Returns
    -------
    StudyView
        Object that notebooks show as HTML.

    Raises
    ------
    InputError
        if the object is anything else.
    """
    leaves = getattr(study, "leaves", [study])
    if not all("curve" in getattr(leaf, "attrs", {}) and "replicate_power" in leaf for leaf in leaves):
        raise InputError(f"study = {type(study).__name__} is not allowed: a result of sweep or open_study is needed.")
    return StudyView(study)


def html_of(shown: Displayed) -> str:
    """HTML view of an object of this package: a drawing, table or plot.

    Parameters
    ----------
    shown : Displayed
        Object of this package.

    Returns
    -------
    str
        HTML.
    """
    return next(_VIEWS[kind.__name__](shown) for kind in type(shown).__mro__ if kind.__name__ in _VIEWS)


def _pad_html(pad: Pad) -> str:
    """HTML of a pad: its section and plan, with dimensions."""
    from mitsuba_taxel.report.notebook.pad_drawing import draw_pad

    count = f"{pad.rows} x {pad.columns} {pad.cell} cells"
    return _framed(f"Pad: {count}", draw_pad(pad), _line("Section through the middle row, and plan; lengths in mm."))


def _block_html(block: Block) -> str:
    """HTML of a block without cells: its sections, with dimensions."""
    from mitsuba_taxel.report.notebook.pad_drawing import draw_surface

    mesh = block.mesh(block.default_mesh_size)
    note = _line("Section through the middle, and plan; lengths in mm.")
    return _framed("Pad: a block without cells", draw_surface(mesh.points, mesh.faces[:, :3]), note)


def _pad_file_html(pad: PadFile) -> str:
    """HTML of a pad from a file, with its sections if the file is a surface of triangles."""
    from mitsuba_taxel.geometry.geometry_error import GeometryError
    from mitsuba_taxel.pads.imported.surfaces import read_surface
    from mitsuba_taxel.pads.pad_file import SURFACE_FORMATS
    from mitsuba_taxel.report.notebook.pad_drawing import draw_surface

    rules = f"{len(pad.regions)} rules name its regions." if pad.regions else "Its regions follow from its shape."
    drawing = _line("A solid, whose surface is known only after meshing.")
    if pad.suffix in SURFACE_FORMATS:
        try:
            drawing = draw_surface(*read_surface(pad.content(), pad.suffix, pad.placement))
            drawing += _line("Section through the middle, and section just above the board; lengths in mm.")
        except InputError as error:
            drawing = _line(str(error))
        except GeometryError as error:
            drawing = _line(f"It cannot be drawn: {error}.")
    return _framed(f"Pad: {pad.path.name}", drawing, _line(rules))


def _viscoelastic_html(silicone: Viscoelastic) -> str:
    """HTML of a viscoelastic silicone: its instantaneous law and its Prony series."""
    long_term = 1 - silicone.shares.sum()
    rows = [(f"{fraction:.6g}", f"{time:.6g}") for fraction, time in silicone.prony]
    long_term_line = _line(f"Long-term fraction of the stress: {long_term:.6g}.")
    memory = _framed("Relaxation", long_term_line, _table(("share", "time [s]"), rows))
    return _material_html(silicone.law) + memory


def _mullins_html(silicone: Mullins) -> str:
    """HTML of a silicone with Mullins' effect: the law of the first loading and the constants of the effect."""
    rows = zip(("r", "m", "beta"), (f"{value:.6g}" for value in silicone.constants), ("", "MPa", ""), strict=True)
    softening = _framed("Mullins' effect", _table(("constant", "value", "unit"), rows))
    return _material_html(silicone.law) + softening


def _material_html(material: Material | Viscoelastic | Mullins) -> str:
    """HTML of a material law: its constants and the moduli computed from them."""
    from mitsuba_taxel.mechanics import Mullins, Viscoelastic
    from mitsuba_taxel.parameters import parameters_of

    if isinstance(material, Viscoelastic):
        return _viscoelastic_html(material)
    if isinstance(material, Mullins):
        return _mullins_html(material)
    law = (type(material).__doc__ or "").strip().splitlines()[0].rstrip(".")
    units = {name: parameter.unit for name, parameter in parameters_of(type(material)).items()}
    rows = [(name, f"{getattr(material, name):.6g}", units.get(name, "")) for name in material.parameters]
    derived = {"shear_modulus": "MPa", "youngs_modulus": "MPa", "compressibility": "1/MPa"}
    rows += [
        (f"{name} (derived)", f"{getattr(material, name):.6g}", unit)
        for name, unit in derived.items()
        if name not in material.parameters
    ]
    return _framed(type(material).__name__, _line(law), _table(("constant", "value", "unit"), rows))


def _silicone_html(silicone: Silicone) -> str:
    """HTML of a measured silicone: its law, source and range."""
    strain = silicone.max_strain
    range_ = "" if strain is None else _line(f"Fitted up to a nominal strain of {strain:.0%}.")
    return _material_html(silicone.material) + _line(f"Source: {silicone.source}.") + range_


def _listed(numbers: Iterable[float]) -> str:
    return ", ".join(f"{number:g}" for number in numbers)


def _state_html(state: State) -> str:
    """HTML of a state of a pad: its deformation and its accuracy."""
    load = state.load
    largest = float(np.linalg.norm(state.displacement, axis=1).max())
    rows = [
        (f"{load.quantity} [{load.unit}]", _listed(state.value[:3])),
        *([("moment [N mm]", _listed(state.value[3:]))] if load.tilts else []),
        ("largest displacement [mm]", f"{largest:.5g}"),
        ("least volume ratio J", f"{state.min_jacobian:.4f}"),
        ("residual", f"{state.residual:.0e}"),
        ("stability", "checked" if state.stability_checked else "not checked"),
        ("elements", f"{len(state.mesh.tets)}"),
        ("seconds to solve", f"{state.seconds:.2g}"),
    ]
    error = state.error
    if error is None:
        rows.append(("error of the roofs", "unknown"))
    else:
        rows.append(("error of the roofs [mm]", f"{error.displacement:.2g} (at worst {error.largest:.2g})"))
        rows.append(("error of their slope [degrees]", f"{error.slope:.2g}"))
    return _framed(f"Deformed pad, {type(load).__name__}", _table(("", "value"), rows))


def _sensor_html(sensor: PadSensor) -> str:
    """HTML of a sensor: its pad, silicone, load and optical parts."""
    package, load = sensor.photo_reflector.package, sensor.load
    moment = f", moment = ({_listed(sensor.force[3:])}) N mm" if load.tilts else ""
    components = {
        "load": f"{type(load).__name__}, {load.quantity} = ({_listed(sensor.force[:3])}) {load.unit}{moment}",
        "roof": sensor.roof,
        "side": sensor.side,
        "finish": "smooth" if sensor.finish is None else sensor.finish,
        "photo-reflector": f"spacing {package.detector.x - package.emitter.x:g} mm",
        "LED": package.led,
        "phototransistor": package.phototransistor,
        "body": sensor.photo_reflector.wall,
    }
    rows = [
        (name, component if isinstance(component, str) else _values_in_words(component))
        for name, component in components.items()
    ]
    return _pad_html(sensor.pad) + _material_html(sensor.material) + _framed("Sensor", _table(("part", ""), rows))


def _scene_html(scene: Scene) -> str:
    """HTML of a scene: its parameters, and its parts if it was made in Python."""
    if isinstance(scene.source, dict):
        items = scene.source.items()
        entries = [(name, entry["type"]) for name, entry in items if isinstance(entry, Mapping) and "type" in entry]
        return _framed(f"Scene: {scene.name}", _table(("part", "plugin"), entries))
    rows = [(name, value, scene.defaults.get(name, "")) for name, value in scene.parameters.items()]
    table = _table(("parameter", "value", "default"), rows) if rows else _line("It has no parameters.")
    return _framed(f"Scene: {scene.name}", table)


def _readings_html(readings: Readings) -> str:
    """HTML of readings: power and error of each taxel, and the error budget."""
    columns = readings_columns(readings)
    lines = [light_error_line(readings), *readings.notes, f"{budget_line(readings.error_budget)}."]
    table = _table(list(columns), list(zip(*columns.values(), strict=True)))
    return _framed("Readings", table, *map(_line, lines))


def _study(study: xr.Dataset, name: str) -> str:
    from mitsuba_taxel.characterise import sensitivity_table, volts_notes, volts_table
    from mitsuba_taxel.electronics.volts import circuit_of_study, in_volts
    from mitsuba_taxel.studies import study_error_budget

    circuit, sensitivities = circuit_of_study(study), _numbers(sensitivity_table(study))
    volts: list[str] = []
    if circuit is not None:
        shown = volts_table(study, circuit)
        volts = [_plot(in_volts(study, circuit), "Voltage"), _numbers(shown), *map(_line, volts_notes(shown, circuit))]
    failures = study.attrs["failures"].splitlines()
    lines = [*study.attrs["notes"].splitlines(), *(f"failed: {line}" for line in failures[:MOST_LINES])]
    if len(failures) > MOST_LINES:
        lines.append(f"failed: {len(failures) - MOST_LINES} more")
    budget = _line(f"{budget_line(study_error_budget(study))}.")
    return _framed(f"Study: {name}", _plot(study, "Optical power"), sensitivities, *volts, budget, *map(_line, lines))


def _numbers(table: pandas.DataFrame) -> str:
    rows = [[_cell(value) for value in row] for row in table.itertuples(index=False)]
    return _table([str(column) for column in table.columns], rows) if rows else ""


def _plot(study: xr.Dataset, quantity: str) -> str:
    """HTML of a plot of a study on a white background. It is embedded as a separate image, because glyph names of
    inline SVG would clash with those of other plots."""
    from mitsuba_taxel.plots.curves import plot_curves

    picture, form = BytesIO(), "svg" if study.power.size <= MOST_DRAWN else "png"
    plot_curves(study).savefig(picture, format=form)
    kind = "image/svg+xml" if form == "svg" else "image/png"
    content = base64.b64encode(picture.getvalue()).decode("ascii")
    words = f"{quantity} of {study.sizes['taxel']} taxels against {study.attrs['curve']}, with error bars"
    return f'<img src="data:{kind};base64,{content}" alt="{escape(words)}" style="max-width: 100%; background: white">'


def _values_in_words(component: Any) -> str:
    """Text with the parameters of a component that have a value."""
    from mitsuba_taxel.parameters import parameters_of

    values = ((parameter, getattr(component, name)) for name, parameter in parameters_of(type(component)).items())
    words = (
        f"{parameter.name} = {parameter.words(value)} {parameter.unit}"
        for parameter, value in values
        if value is not None
    )
    return ", ".join(map(str.strip, words))


def _framed(title: str, *blocks: str) -> str:
    return f"<div><strong>{escape(title)}</strong>{''.join(f'<div>{block}</div>' for block in blocks if block)}</div>"


def _line(text: str) -> str:
    return f"<div>{escape(text)}</div>"


def _table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """HTML of a table; of a long table, only the beginning and the end. The first column is aligned left."""
    chosen = list(rows)
    if len(chosen) > 2 * MOST_LINES + 1:
        chosen = [*chosen[:MOST_LINES], ["..."] * len(headings), *chosen[-MOST_LINES:]]
    head = _row("th", headings)
    return f"<table><thead>{head}</thead><tbody>{''.join(_row('td', row) for row in chosen)}</tbody></table>"


def _row(kind: str, cells: Sequence[object]) -> str:
    sides = ["left", *["right"] * (len(cells) - 1)]
    words = (
        f'<{kind} style="text-align: {side}">{escape(str(cell))}</{kind}>'
        for side, cell in zip(sides, cells, strict=True)
    )
    return f"<tr>{''.join(words)}</tr>"


def _cell(value: object) -> str:
    return f"{value:.3e}" if isinstance(value, float) else str(value)


_VIEWS: dict[str, Callable[..., str]] = {
    "Pad": _pad_html,
    "PadFile": _pad_file_html,
    "Block": _block_html,
    "Material": _material_html,
    "Viscoelastic": _viscoelastic_html,
    "Mullins": _mullins_html,
    "Silicone": _silicone_html,
    "State": _state_html,
    "PadSensor": _sensor_html,
    "Scene": _scene_html,
    "Readings": _readings_html,
}
"""View of each class, by the name of the class, so that classes are imported only when shown."""
