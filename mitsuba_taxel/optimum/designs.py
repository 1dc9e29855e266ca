"""Evaluation of designs. Each load of a design is a job of one study that grows, so that nothing is computed twice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.backend import activate_variant
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics.meshes import pad_mesh
from mitsuba_taxel.optimum.contacts import DesignContact, first_contact_in, lines_without_contact, undetermined_end
from mitsuba_taxel.optimum.figures import TINY, DesignResponses, LineResponse
from mitsuba_taxel.optimum.plan import Design, Plan
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.mould import SHAPE
from mitsuba_taxel.sensing.derivatives.derivable import without_derivative
from mitsuba_taxel.sensing.scene.description import MESHED_AS, Scene
from mitsuba_taxel.sensing.scene.left_out import NONE
from mitsuba_taxel.sensing.scene.parsing import parser_config
from mitsuba_taxel.specification.deformable_pad import DeformablePad
from mitsuba_taxel.studies.plan.batch import Batch
from mitsuba_taxel.studies.plan.to_contact import TO_CONTACT
from mitsuba_taxel.studies.plan.vary import STEP, Axis
from mitsuba_taxel.studies.run.pool import Pool
from mitsuba_taxel.studies.run.study import run_batch
from mitsuba_taxel.studies.store.folder import Store
from mitsuba_taxel.studies.store.opening import stored_study

SHIFT = 0.01
"""Step of a variable for central differences of readings, relative to the bounds' width."""
SMALL = 1e-4
"""Step of a variable for differences of figures of the shape, which are exact."""
OTHERS = 2
"""Number of columns after the readings: the largest strain and the clearance."""


@dataclass(frozen=True, eq=False)
class DesignEvaluation:
    """Readings and dimensions of a design, with their derivatives.

    Attributes
    ----------
    values : DesignResponses
        Readings and dimensions.
    by : list[DesignResponses]
        For each variable: complex readings and dimensions, whose imaginary parts are `TINY` times their derivatives
        with respect to the variable, scaled to the unit cube (complex-step differentiation). Derivatives with respect
        to a variable that does not apply to the design are 0.
    by_tolerance : list[DesignResponses]
        The same for each parameter with a tolerance, with derivatives per standard deviation of the parameter. The
        effect of tolerances on the pad's dimensions is neglected.
    """

    values: DesignResponses
    by: list[DesignResponses]
    by_tolerance: list[DesignResponses]


class _DesignRows(NamedTuple):
    """Rows of a design in the study: one for each load, and for each line the row of its load path to the first
    contact."""

    loads: list[int]
    contacts: dict[str, int]

    @property
    def all(self) -> list[int]:
        """All rows (load steps) that belong to the design."""
        return [*self.loads, *self.contacts.values()]


class DesignEvaluator:
    """Evaluates designs: each load of a design is a job of a study in ``folder``.

    Derivatives are those of the readings if available, else central differences of neighbouring designs.

    Attributes
    ----------
    loads : int
        Number of distinct load steps of all designs.
    seconds : float
        Time of all jobs, including those of earlier runs.
    seconds_of : dict[Design, float]
        Time of the jobs of each design.
    failures : dict[Design, str]
        Reasons why designs failed.
    notes : list[str]
        Remarks on the evaluation.
    has_parts : bool
        Whether a design has deformable pads.
    no_contact : dict[str, str]
        Reasons why the first contact along a line cannot be computed.
    """

    def __init__(self, plan: Plan, pool: Pool, folder: Path, retry_failed: bool, batch: Batch | None = None) -> None:
        self._plan, self._pool, self._folder, self._retry = plan, pool, folder, retry_failed
        self._batch = replace(batch or plan.batch, bare=True)
        self._names = [variable.name for variable in plan.variables]
        other_parameters = [name for name in plan.tolerances if name not in self._names]

        # One valid design for each choice, and the parameters without derivatives in any of these designs.
        first = {design.choice: design for design in reversed(plan.initial_designs())}
        refused: dict[str, str] = {}
        for design in first.values():
            refused |= without_derivative(plan.scene(design), [*self._names, *other_parameters])
        self.notes = [
            f"not evaluated, as no sensor is possible within the bounds: {', '.join(choice)}"
            for choice in product(*plan.choices.values())
            if choice not in first
        ]
        self.notes += [
            f"derivatives with respect to {name} are differences of readings ({refused[name]})"
            for name in self._names
            if name in refused
        ]
        for name in other_parameters:
            if name in refused:
                raise InputError(f"tolerance of {name} cannot be computed: {refused[name]}")

        # Parameters with derivatives, whether designs have pads and first contacts, and empty results.
        self._by = [name for name in [*self._names, *other_parameters] if name not in refused]
        self._has_pads = any(pads_of(plan.scene(design)) for design in first.values())
        self.has_parts = any(parts_of(plan.scene(design)) for design in first.values())
        self.no_contact = lines_without_contact(plan, self._batch, list(first.values()))
        self.failures: dict[Design, str] = {}
        self.loads, self.seconds = 0, 0.0
        self.seconds_of: dict[Design, float] = {}
        self._rows: set[int] = set()
        self._contact_rows: set[int] = set()
        self._evaluated: dict[Design, DesignEvaluation] = {}
        self._study_so_far: xr.Dataset | None = None

    def can_move(self, design: Design) -> bool:
        """Whether the mesh of another design, the design's ``origin``, can be moved to fit this design. A design
        without pads has no mesh to move.
        """
        if not (self._has_pads and pads_of(self._plan.scene(design.alone))):
            return False
        try:
            for pad_element in parts_of(self._batch.scene(self._plan.scene_parameters(design))):
                if pad_element.filename is None:
                    pad = pad_element.build_pad()
                    for size in {
                        pad.default_mesh_size,
                        pad_element.mesh_size or pad.default_mesh_size,
                    }:  # at rest, and loaded
                        pad_mesh(pad, size)
        except ComputationError:
            return False
        return True

    def read(self, designs: Sequence[Design]) -> list[DesignEvaluation | None]:
        """Evaluate designs; None for a design that fails, whose reason is in ``failures``."""
        new = [design for design in dict.fromkeys(designs) if design not in self._evaluated | self.failures]
        for design in new:
            refusal = self._plan.refusal(design)
            if refusal is not None:
                self.failures[design] = str(refusal)
        self._read([design for design in new if design not in self.failures])
        return [self._evaluated.get(design) for design in designs]

    def _read(self, designs: list[Design]) -> None:
        """Evaluate valid designs, all in one extension of the study, and record their results or failures."""
        if not designs:
            return
        shifted = {design: self._shifted(design) for design in designs}
        needed = [variant for design in designs for variant in (design, *shifted[design].values())]
        study, rows_of = self._study(needed)

        # Readings by random paths have no derivatives: all designs are then evaluated by differences, in a separate
        # study.
        if self._by and "smooth_power" not in study:
            if set(self._by) - set(self._names):
                raise InputError(f"tolerances cannot be computed: {study.attrs['notes'].splitlines()[0]}")
            self.notes += [f"derivatives are differences of readings: {study.attrs['notes'].splitlines()[0]}"]
            self._by = []
            self._read(designs)
            return

        # Time and number of load steps of all designs.
        self._rows |= {number for variant in needed for number in rows_of[variant].loads}
        self._contact_rows |= {number for variant in needed for number in rows_of[variant].contacts.values()}
        self.loads = len(self._rows)
        self.seconds = float(study.seconds.isel({STEP: sorted(self._rows | self._contact_rows)}).sum())

        # Readings, derivatives and first contacts of each design; a design with a missing value fails.
        failed = Store(self._study_folder).failures()
        for design in designs:
            rows = {variant: rows_of[variant] for variant in (design, *shifted[design].values())}
            job_numbers = sorted({number for of_variant in rows.values() for number in of_variant.all})
            self.seconds_of[design] = float(study.seconds.isel({STEP: job_numbers}).sum())
            power = {variant: self._power(study, of_variant.loads) for variant, of_variant in rows.items()}
            rates = self._rates(study, design, rows[design].loads, shifted[design], power)
            contacts = self._contacts(study, design, rows, shifted[design])
            required = [power[design][:, :-OTHERS], rates[..., :-OTHERS]]
            required += [np.array([contact.value, *contact.by]) for contact in contacts.values()]
            if all(np.isfinite(array).all() for array in required):
                by_tolerance = self._by_tolerance(study, rows[design].loads, rates)
                read = self._seen(design, power[design], rates, by_tolerance, contacts)
                ended = undetermined_end(self._plan, read.values, contacts)
                if ended:
                    self.failures[design] = ended
                else:
                    self._evaluated[design] = read
            else:
                numbers = (number for of_variant in rows.values() for number in of_variant.all)
                reasons = [failed[number].message for number in numbers if number in failed]
                notes = [note for note in study.attrs["notes"].splitlines() if "not available" in note]
                self.failures[design] = next(iter([*reasons, *notes]), "a reading or a derivative is missing")

    def write_tables(self) -> None:
        """Write the readings of all designs to ``readings.nc`` and ``readings.csv`` of the study.

        This is done once, at the end: to write the table after each design would take longer with each design.
        """
        if self._study_so_far is not None:
            from mitsuba_taxel.studies.store.tables import write_readings

            write_readings(self._study_so_far, self._study_folder)

    @property
    def _study_folder(self) -> Path:
        """Folder of the study; evaluation by differences has a separate folder, as its rows differ."""
        return self._folder if self._by else self._folder.with_name(f"{self._folder.name}_by_differences")

    def _shifted(self, design: Design) -> dict[tuple[int, int], Design]:
        """Neighbouring designs for central differences. The key of a neighbour is the index of the variable that
        differs (a variable without derivative), and the sign of its change.

        A neighbour has the mesh of the design, moved. If the neighbour is refused, the design itself is used instead,
        for a one-sided difference.
        """
        neighbours = {}
        for number, name in enumerate(self._names):
            for sign in (1, -1) if name not in self._by and self._has(design)[number] else ():
                neighbour = _changed(design, number, sign * SHIFT)
                if self._has_pads:
                    neighbour = replace(neighbour, origin=design.family)
                neighbours[number, sign] = design if self._plan.refusal(neighbour) else neighbour
        return neighbours

    def _has(self, design: Design) -> list[bool]:
        return self._plan.has(design.choice)

    def _study(self, designs: Sequence[Design]) -> tuple[xr.Dataset, dict[Design, _DesignRows]]:
        """Extend the study by designs, and run it.

        Returns
        -------
        study : xr.Dataset
            Readings over steps, with derivatives with respect to the parameters in `_by`.
        rows_of : dict[Design, _DesignRows]
            Rows of each design.
        """
        # Columns: parameters of designs, loads, moved meshes and first contacts.
        names = [*self._plan.parameters(designs[0]), *dict.fromkeys(n for row in self._plan.loads for n in row)]
        names += [*([MESHED_AS] if self._has_pads else []), *([TO_CONTACT] if self.has_parts else [])]
        contact_loads = {line: load for line, load in self._plan.to_contact.items() if line not in self.no_contact}

        # Rows: the stored rows, if their columns are the same, then the designs at all loads.
        base = self._plan.base
        stored = stored_study(self._study_folder).get("together", {})
        rows = dict.fromkeys(zip(*(stored[name] for name in names), strict=True)) if set(names) == set(stored) else {}
        words_of: dict[Design, list[tuple[str, ...]]] = {}
        for design in designs:
            mesh_and_contact = {MESHED_AS: self._plan.mesh_of(design), TO_CONTACT: NONE}
            values = {**base, **self._plan.parameters(design), **mesh_and_contact}
            loads = [*self._plan.loads, *contact_loads.values()]
            words_of[design] = [tuple({**values, **load}[name] for name in names) for load in loads]
            rows |= dict.fromkeys(words_of[design])

        # The study, whose stored results are kept, and the row numbers of the designs.
        columns = {name: list(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}
        batch = replace(self._batch, axes=(Axis(STEP, columns),), derivatives=tuple(self._by))
        study = self._study_so_far = run_batch(batch, self._pool, self._study_folder, self._retry)
        self._retry = False
        row_numbers = {row: number for number, row in enumerate(rows)}
        count, rows_of = len(self._plan.loads), {}
        for design, needed in words_of.items():
            numbers = [row_numbers[row] for row in needed]
            rows_of[design] = _DesignRows(numbers[:count], dict(zip(contact_loads, numbers[count:], strict=True)))
        return study, rows_of

    def _power(self, study: xr.Dataset, rows: list[int]) -> np.ndarray:
        """Readings in W, largest strain, and clearance in mm of each load, in one array (loads, taxels + 2). Strain and
        clearance are NaN if unknown.
        """
        power = study.smooth_power if self._by else study.replicate_power.mean("replicate")
        pad_columns = (
            [study.largest_strain, study.clearance] if self._by else OTHERS * [np.full(study.sizes[STEP], np.nan)]
        )
        return np.column_stack([power.transpose(STEP, "taxel").values, *pad_columns])[rows]

    def _rates(
        self, study: xr.Dataset, design: Design, rows: list[int], shifted: dict, power: dict[Design, np.ndarray]
    ) -> np.ndarray:
        """Derivatives of the result of :meth:`_power` with respect to the variables in the unit cube, (variables,
        loads, taxels + 2).

        Derivatives are taken from the study; otherwise they are central differences to the neighbours ``shifted``.
        """
        rates = np.zeros((len(self._names), *power[design].shape))
        for number, variable in enumerate(self._plan.variables):
            if not self._has(design)[number]:
                continue
            if variable.name in self._by:
                rates[number] = (variable.high - variable.low) * _derivative(study, variable.name, rows)
            else:
                ahead, behind = (shifted[number, sign] for sign in (1, -1))
                width = ahead.x[number] - behind.x[number]
                rates[number] = (power[ahead] - power[behind]) / width if width else np.nan
        return rates

    def _by_tolerance(self, study: xr.Dataset, rows: list[int], rates: np.ndarray) -> list[np.ndarray]:
        """Change of readings, strain and clearance (loads, taxels + 2) by one standard deviation of each tolerance."""
        widths = {variable.name: variable.high - variable.low for variable in self._plan.variables}
        by_variable = {name: rate / width for rate, (name, width) in zip(rates, widths.items(), strict=True)}
        tolerances = self._plan.tolerances.items()
        return [
            sd * (by_variable[name] if name in by_variable else _derivative(study, name, rows))
            for name, sd in tolerances
        ]

    def _contacts(
        self, study: xr.Dataset, design: Design, rows: dict[Design, _DesignRows], shifted: dict[tuple[int, int], Design]
    ) -> dict[str, DesignContact]:
        """First contact along each line, with derivatives from the study or from the neighbours ``shifted``; NaN if
        unknown."""
        contacts = {}
        for line, row in rows[design].contacts.items():
            slopes = {name: first_contact_in(study.sel(parameter=name), row, "_derivative") for name in self._by}
            for number, variable in enumerate(self._plan.variables):
                if (number, 1) in shifted:
                    ahead, behind = (shifted[number, sign] for sign in (1, -1))
                    difference = (variable.high - variable.low) * (ahead.x[number] - behind.x[number])
                    ends = [first_contact_in(study, rows[end].contacts[line]) for end in (ahead, behind)]
                    slopes[variable.name] = (ends[0] - ends[1]) / difference if difference else np.nan
            has = zip(self._plan.variables, self._has(design), strict=True)
            by = [
                (variable.high - variable.low) * slopes[variable.name] if applies else 0.0 for variable, applies in has
            ]
            by_tolerance = [sd * slopes[name] for name, sd in self._plan.tolerances.items()]
            contacts[line] = DesignContact.from_study(study, row, by, by_tolerance)
        return contacts

    def _seen(
        self,
        design: Design,
        power: np.ndarray,
        rates: np.ndarray,
        by_tolerance: list[np.ndarray],
        contacts: dict[str, DesignContact],
    ) -> DesignEvaluation:
        """Create the evaluation of a design from the readings of :meth:`_power`, their derivatives, and the first
        contact along each line."""
        shape, shape_rates = self._shape(design)
        loads = [frozenset(load.items()) for load in self._plan.loads]

        def responses(
            power: np.ndarray, contact_rates: dict[str, float], rate: dict[str, np.ndarray] | None = None
        ) -> DesignResponses:
            # Lines of loads and dimensions for readings ``power`` whose imaginary parts are derivatives.
            lines = {}
            for name, (along, rows) in self._plan.lines.items():
                values = np.array([float(row[along]) for row in rows]) if along else np.zeros(1)
                of_line = power[[loads.index(frozenset(row.items())) for row in rows]]
                strain, clearance = of_line[:, -OTHERS:].T
                contact = contacts.get(name, DesignContact(np.nan, "", "", [], []))
                end = complex(contact.value, TINY * contact_rates.get(name, 0.0))
                lines[name] = LineResponse(
                    values, of_line[:, :-OTHERS], strain, clearance, end, contact.touched, contact.ended
                )
            imaginary = {} if rate is None else {name: 1j * TINY * rate[name] for name in shape}
            figures = {name: values + imaginary.get(name, 0j) for name, values in shape.items()}
            return DesignResponses(lines, figures, self._plan.circuit)

        by = [{line: change.by[number] for line, change in contacts.items()} for number in range(len(rates))]
        contacts_by_tolerance = [
            {line: change.by_tolerance[number] for line, change in contacts.items()}
            for number in range(len(by_tolerance))
        ]
        return DesignEvaluation(
            responses(power + 0j, {}),
            [
                responses(power + 1j * TINY * change, to, of)
                for change, to, of in zip(rates, by, shape_rates, strict=True)
            ],
            [
                responses(power + 1j * TINY * change, to)
                for change, to in zip(by_tolerance, contacts_by_tolerance, strict=True)
            ],
        )

    def _shape(self, design: Design) -> tuple[dict[str, np.ndarray], list[dict[str, np.ndarray]]]:
        """Dimensions of the pads (N,) by name, and the derivatives of these with respect to each variable in the unit
        cube. Both are empty if no figure of merit of the study depends on dimensions.
        """
        if not any(figure.kind in SHAPE for figure in self._plan.figures):
            none = {name: np.zeros(0) for name in SHAPE}
            return none, [none] * len(self._names)
        rates = []
        for number in range(len(self._names)):
            if not self._has(design)[number]:
                rates.append({name: np.zeros(1) for name in SHAPE})
                continue
            ends = [_changed(design, number, sign * SMALL) for sign in (1, -1)]
            ahead, behind = (design if self._plan.refusal(end) else end for end in ends)
            width, pair = ahead.x[number] - behind.x[number], (self._shape_of(ahead), self._shape_of(behind))
            rates.append({name: (pair[0][name] - pair[1][name]) / (width or np.nan) for name in SHAPE})
        return self._shape_of(design), rates

    def _shape_of(self, design: Design) -> dict[str, np.ndarray]:
        """Dimensions (N,) of all pads of a design that figures of merit need, by name."""
        pads = pads_of(self._plan.scene(design))
        return {name: np.concatenate([np.zeros(0), *map(of, pads)]) for name, of in SHAPE.items()}


def _derivative(study: xr.Dataset, name: str, rows: list[int]) -> np.ndarray:
    """Derivatives (loads, taxels + 2) of readings, largest strain and clearance with respect to a parameter."""
    rates = study.sel(parameter=name)
    of_power = rates.derivative.transpose(STEP, "taxel").values
    return np.column_stack([of_power, rates.largest_strain_derivative, rates.clearance_derivative])[rows]


def _changed(design: Design, number: int, step: float) -> Design:
    """Copy of a design with one variable changed by a small step, within its bounds."""
    x = list(design.x)
    x[number] = min(max(x[number] + step, 0.0), 1.0)
    return replace(design, x=tuple(x))


def parts_of(scene: Scene) -> list[DeformablePad]:
    """Parameters of all deformable pads of a scene, as objects of their plugin's specification."""
    with scene.files_beside_it():
        nodes = scene.parsed(parser_config(activate_variant())).nodes
        return [DeformablePad.read(n.props) for n in nodes if n.props.plugin_name() == DeformablePad.plugin]


def pads_of(scene: Scene) -> list[Pad]:
    """The undeformed pads of a scene, except those from files."""
    built = (specification.build_pad() for specification in parts_of(scene) if specification.filename is None)
    return [pad for pad in built if isinstance(pad, Pad)]
