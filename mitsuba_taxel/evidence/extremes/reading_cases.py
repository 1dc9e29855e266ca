"""Extreme cases of readings: narrow gaps and closing cells, little light, many samples, taxels and load steps.

A reading is compared with a run of `analog_tracer`, which counts rays, or with a scaling law; some cases must be
refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from mitsuba_taxel import parts
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.evidence.extremes.reading_row import MOST_DEVIATIONS, RIGHT, ReadingRow
from mitsuba_taxel.evidence.extremes.table_case import TimedCase
from mitsuba_taxel.evidence.rows.kind_examples import pad_of
from mitsuba_taxel.mechanics.materials.laws import NeoHookean
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic
from mitsuba_taxel.pads.cells.cell_shape import CellShape
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.parts import mirror_curve, read_part
from mitsuba_taxel.sensing import PadSensor, Readings, Scene, measure
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.specification.annular_led import AnnularLed
from mitsuba_taxel.specification.photo_reflector import PhotoReflector
from mitsuba_taxel.specification.wall import Wall

LOW_CELL = Pad("cylindrical", rows=1, columns=1, height=3.0, cell_height=0.85)
"""A cell whose roof is 0.35 mm above the package."""
ROUNDING = 1e-6
"""Relative error with which scaling laws are fulfilled: rounding of single precision."""
OF_TIME_STEPS = 1e-4
"""Relative error of readings due to time steps, and to relaxation during a short rise of the load."""
OF_QUADRATURE = 2e-3
"""Relative error of the power under a mirror due to quadrature."""
VCNT2020 = Path(parts.__file__).parent / "catalogue" / "vcnt2020.toml"
MIRROR = """<scene version="3.9.0">
    <shape type="photo_reflector">
        <string name="part" value="part.toml"/>
        <vector name="led_shift" value="{shift}"/> <vector name="phototransistor_shift" value="{shift}"/>
    </shape>
    <shape type="rectangle">
        <transform name="to_world"> <rotate x="1" angle="180"/> <scale value="500"/> <translate z="{z}"/> </transform>
        <bsdf type="wall"> <string name="scattering" value="mirror"/> </bsdf>
    </shape>
</scene>"""
POINTS_OF_A_BILLION = 1 << 20

read = partial(measure, mechanics_error=False)
"""Function that computes readings without the error of the mechanics, which no row shows and which would need a second
mesh."""


@dataclass(frozen=True)
class ComparedReading:
    """The reading of the taxel that deviates most from its reference value, and that value.

    Attributes
    ----------
    power, error : float
        Reading and its standard error, in W.
    reference, reference_error : float
        Reference value and its standard error, in W.
    by : str
        Source of the reference value.
    remark : str
        Note for the reader.
    """

    power: float
    error: float
    reference: float
    reference_error: float
    by: str
    remark: str = ""


@dataclass(frozen=True)
class ReadingCase(TimedCase):
    """An extreme case of a reading.

    Attributes
    ----------
    look : Callable[[], ComparedReading]
        Computes the reading and its reference value; raises `InputError` or `ComputationError` if the scene is refused.
    refused : bool
        Whether the program must refuse the scene.
    """

    ROW = ReadingRow
    name: str
    look: Callable[[], ComparedReading]
    refused: bool = False

    def _row(self) -> ReadingRow:
        try:
            compared = self.look()
        except (InputError, ComputationError) as error:
            return ReadingRow(self.name, f"refused: {error}", wrong="" if self.refused else "it should not be refused")
        spread = np.hypot(compared.error, compared.reference_error)
        change = compared.power - compared.reference
        deviations = 0.0 if change == 0 else float(np.divide(change, spread))
        right = np.isfinite(compared.power) and abs(deviations) < MOST_DEVIATIONS
        return ReadingRow(
            case=self.name,
            verdict=f"{RIGHT}{compared.remark and '; '}{compared.remark}",
            wrong="it should be refused" if self.refused else "" if right else "it deviates from its reference",
            power=compared.power,
            error=compared.error / compared.power if compared.power > 0 else 0.0,
            reference=compared.reference,
            deviations=deviations,
            by=compared.by,
        )


def reading_cases() -> list[ReadingCase]:
    """All cases whose readings are compared, in the order of the table."""
    return [case for kind in (_gaps, _windows, _walls, _little, _loads, _times, _sizes, _numbers) for case in kind()]


def _gaps() -> Iterator[ReadingCase]:
    for z in (0.1, 0.02):
        for scattering in ("lambertian", "isotropic"):
            compare = partial(_against_counted, _plate(z=z, scattering=scattering), points=1 << 16)
            yield ReadingCase(f"plate {z:g} mm above the LED, {scattering}", compare)
    yield ReadingCase("plate 1e-5 mm above the LED, lambertian", _all_but_closed)
    yield ReadingCase("plate on the LED", _closed)


def _windows() -> Iterator[ReadingCase]:
    for height in (0.02, 0.1, 10.0):
        yield ReadingCase(f"VCNT2020, {height:g} mm below a mirror", partial(_below_a_mirror, height))
    for index in (1.0, 3.5):
        yield ReadingCase(
            f"VCNT2020 in resin of index {index:g}, 1 mm below a mirror", partial(_below_a_mirror, 1.0, index)
        )
    deep_shift, sideways_shift = (0.0, 0.0, -0.65), (0.0, 1.05, -0.4)
    for words, shift in (("0.75 mm deep", deep_shift), ("0.5 mm deep and cut by their windows", sideways_shift)):
        compare = partial(_below_a_mirror, 1.0, shift=shift)
        yield ReadingCase(f"VCNT2020 with dies {words}, 1 mm below a mirror", compare)
    compare = partial(_below_a_mirror, 1.0, shift=(0.0, 0.0, -0.75))
    yield ReadingCase("VCNT2020 with dies as deep as its body", compare, refused=True)


def _walls() -> Iterator[ReadingCase]:
    white = Wall("lambertian", 1.0)
    for shape in CellShape.kinds():
        sensor = PadSensor(pad=pad_of(shape, rows=1, columns=1), roof=white, side=white)
        yield ReadingCase(f"{shape}, all walls white (reflectance 1)", partial(_against_counted, sensor.scene))
    narrow = PhotoReflector(led=AnnularLed(law="uniform_solid_angle", cone_angle=1.0))
    sensor = PadSensor(pad=Pad("hemispheric", rows=1, columns=1), photo_reflector=narrow)
    yield ReadingCase("LED with a cone of 1 degree, hemispheric", partial(_against_counted, sensor.scene))


def _little() -> Iterator[ReadingCase]:
    yield ReadingCase("LED of 1e-7 W: readings of 1e-9 W", partial(_little_light, 1e-7))
    yield ReadingCase("LED of 1e-30 W", partial(_little_light, 1e-30))


def _loads() -> Iterator[ReadingCase]:
    soft = PadSensor(pad=LOW_CELL, material=NeoHookean(0.416), roof=Wall("lambertian", 0.9))
    for force in (-1.0, -1.3):
        compare = partial(_against_counted, replace(soft, force=(0.0, 0.0, force)).scene)
        yield ReadingCase(f"cell that {force:g} N all but closes", compare)
    yield ReadingCase("roof pressed onto the LED", partial(_read, replace(soft, force=(0.0, 0.0, -3.0)).scene), True)
    pad = PadSensor(pad=Pad(), material=NeoHookean(0.05), force=(0.0, 0.0, -20.0))
    yield ReadingCase("pad of 0.05 MPa under -20 N", partial(_read, pad.scene), True)
    for force in (0.0, 1e-9, -1e-9):
        yield ReadingCase(f"force of {force:g} N", partial(_next_to_nothing, force))
    yield ReadingCase("a million load steps asked of a study", _million_scenes, True)
    yield ReadingCase("a million load steps asked of a path", _million_states, True)


def _times() -> Iterator[ReadingCase]:
    far_apart, all_but_all = ((0.3, 1e-6), (0.3, 1e6)), ((1 - 1e-6, 1.0),)
    words, rise = "relaxation times of 1e-6 and 1e6 s", 1e-9
    for hold, remaining in ((0.0, 1.0), (1.0, 0.7), (1e9, 0.4)):
        yield ReadingCase(
            f"{words}, {rise:g} s and {hold:g} s more", partial(_relaxed, far_apart, -1.0, rise, hold, remaining)
        )
    yield ReadingCase(f"{words}, loaded for 1e+09 s", partial(_relaxed, far_apart, -1.0, 1e9, 0.0, 0.4))
    words = "a silicone of which 1e-6 remains"
    yield ReadingCase(f"{words}, loaded for {rise:g} s", partial(_relaxed, all_but_all, -1.0, rise, 0.0, 1.0))
    yield ReadingCase(f"{words}, 1e-6 N for 1e+09 s", partial(_relaxed, all_but_all, -1e-6, rise, 1e9, 1e-6))
    yield ReadingCase(f"{words}, 1 N for 1e+09 s", partial(_relaxed, all_but_all, -1.0, rise, 1e9, 1e-6), True)


def _sizes() -> Iterator[ReadingCase]:
    for scale, name in ((1e-3, "metres"), (1e3, "micrometres")):
        yield ReadingCase(f"pad under -10 N in {name}", partial(_scaled, scale))
    yield ReadingCase("30 x 30 taxels under one plate", _many_taxels)


def _numbers() -> Iterator[ReadingCase]:
    yield ReadingCase("a billion samples", _billion)


def _plate(**parameters: object) -> Callable[[], Scene]:
    return partial(Scene.from_file, "plate.xml", **parameters)


def _read(scene: Callable[[], Scene]) -> ComparedReading:
    readings = read(scene(), points=256)
    return _compared(readings, readings, "nothing")


def _against_counted(scene: Callable[[], Scene], points: int = 1 << 15) -> ComparedReading:
    """Compare a reading with one by `analog_tracer`, which counts rays."""
    import mitsuba as mi

    prepared = prepare(scene())
    counted = prepared._replace(integrator=mi.load_dict({"type": "analog_tracer"}))
    return _compared(read(prepared, points=4096, seed=1), read(counted, points=points, seed=2), "counted rays")


def _below_a_mirror(
    height: float, index: float = 1.5, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> ComparedReading:
    """Compare the reading of a VCNT2020 below a mirror with a quadrature that includes refraction; the resin and the
    position of the dies may be changed."""
    with TemporaryDirectory() as folder:
        file, scene = Path(folder) / "part.toml", Path(folder) / "scene.xml"
        text = VCNT2020.read_text(encoding="utf-8").replace("resin_index = 1.5", f"resin_index = {index}")
        file.write_text(text, encoding="utf-8")
        part = read_part(file)
        scene.write_text(MIRROR.format(shift=", ".join(map(str, shift)), z=part.body[2] + height), encoding="utf-8")
        readings = read(Scene(scene), points=1 << 13)
    emitter, detector = (side.moved(shift) for side in (part.emitter, part.detector))
    (expected,) = mirror_curve(replace(part, emitter=emitter, detector=detector), height).tolist()
    power, error = float(readings.power[0]), float(readings.standard_error[0])
    return ComparedReading(power, error, expected, OF_QUADRATURE * expected, "quadrature of refraction")


def _compared(
    readings: Readings, reference: Readings, by: str, remark: str = "", rounding: float = 0.0
) -> ComparedReading:
    """Compare two readings at the taxel with the largest difference in units of the combined error. ``rounding`` is an
    additional error, relative to the reference value."""
    spread = np.hypot(readings.standard_error, reference.standard_error) + rounding * reference.power
    change = np.abs(readings.power - reference.power)
    worst = int(np.argmax(np.divide(change, spread, out=np.zeros_like(change), where=spread > 0)))
    errors = (
        float(column[worst])
        for column in (readings.standard_error, reference.standard_error + rounding * reference.power)
    )
    error, reference_error = errors
    return ComparedReading(
        float(readings.power[worst]), error, float(reference.power[worst]), reference_error, by, remark
    )


def _all_but_closed() -> ComparedReading:
    """Compare the readings of two narrow gaps between LED and plate: the power is proportional to the square of the
    gap's height."""
    wide, narrow = (read(_plate(z=z, scattering="lambertian")(), points=1 << 14) for z in (1e-4, 1e-5))
    scaled = replace(wide, replicates=wide.replicates * 1e-2)
    return _compared(narrow, scaled, "law of scale", rounding=1e-2)


def _closed() -> ComparedReading:
    """Read a scene with a plate on the LED: no light may be found, and a note must say so."""
    readings = read(_plate(z=0, scattering="lambertian")(), points=1 << 12)
    noted = any("no light found" in note for note in readings.notes)
    return replace(
        _compared(readings, readings, "nothing passes"), reference=0.0, remark="said so" if noted else "NOT SAID"
    )


def _little_light(watts: float) -> ComparedReading:
    """Compare the readings of LEDs of two powers, to which they are proportional."""

    def at(power: float) -> Readings:
        led = AnnularLed(power=power)
        sensor = PadSensor(pad=Pad(rows=1, columns=1), photo_reflector=PhotoReflector(led=led))
        return read(sensor.scene(), points=4096)

    full = at(1.0)
    return _compared(at(watts), replace(full, replicates=full.replicates * watts), "law of scale", rounding=ROUNDING)


def _next_to_nothing(force: float) -> ComparedReading:
    """Compare readings under a tiny force with readings without a force."""
    loaded, unloaded = (
        read(PadSensor(pad=Pad("spherical", 1, 1), force=(0.0, 0.0, z)).scene(), points=4096) for z in (force, 0.0)
    )
    return _compared(loaded, unloaded, "the unloaded pad", rounding=ROUNDING)


def _relaxed(
    prony: tuple[tuple[float, float], ...], force: float, rise: float, hold: float, remaining: float
) -> ComparedReading:
    """Compare a relaxed viscoelastic pad with an elastic pad of the remaining stiffness.

    The pad is incompressible, so that relaxation only scales its stiffness. The load rises for the time ``rise`` and is
    constant for the time ``hold``, in s; ``remaining`` is the fraction of the stiffness that is left then.
    """
    law, load = NeoHookean(poisson_ratio=0.5), (0.0, 0.0, force)
    elastic = PadSensor(
        pad=Pad(rows=1, columns=1), material=NeoHookean(remaining * law.youngs_modulus, 0.5), force=load
    )
    silicone = replace(
        elastic, material=Viscoelastic(law, prony), time=rise + hold, history=((rise, load),) if hold else ()
    )
    relaxed, expected = (read(sensor.scene(), points=4096) for sensor in (silicone, elastic))
    return _compared(relaxed, expected, "an elastic pad", rounding=OF_TIME_STEPS)


def _million_scenes() -> ComparedReading:
    from mitsuba_taxel.studies import sweep

    sweep("pad.xml", {"fz": "0:-20:-0.00002"}, points=64)
    raise AssertionError("a million scenes were read")


def _million_states() -> ComparedReading:
    from mitsuba_taxel.mechanics import load_path

    load_path(Pad(), NeoHookean(), np.linspace([0, 0, 0], [0, 0, -20.0], 1_000_000))
    raise AssertionError("a million states were kept")


def _scaled(scale: float) -> ComparedReading:
    """Compare a pad with the same pad in another unit of length."""
    import mitsuba as mi

    sensor = PadSensor(pad=Pad("cylindrical", 1, 1), force=(0.0, 0.0, -1.0), roof=Wall("lambertian", 0.9))
    source = sensor.scene().source
    assert isinstance(source, dict)
    scaling = mi.ScalarTransform4f().scale(scale)
    scaled = {
        name: {**entry, "to_world": scaling @ entry.get("to_world", mi.ScalarTransform4f())}
        if isinstance(entry, dict) and name in ("pad", "photo_reflector", "board")
        else entry
        for name, entry in source.items()
    }
    return _compared(
        read(Scene(scaled), points=4096), read(Scene(source), points=4096), "the pad in millimetres", rounding=1e-4
    )


def _many_taxels() -> ComparedReading:
    """Compare the taxels of a large array under a wide plate with a single taxel."""

    def at(rows: int, points: int, seed: int) -> Readings:
        return read(_array(rows, rows), points=points, seed=seed)

    array, single = at(30, 256, 1), at(1, 1 << 13, 2)
    repeated = replace(single, replicates=np.tile(single.replicates, (1, 900)))
    compared = _compared(array, repeated, "one alone")
    probability = 1 / 900  # Bonferroni's bound for the worst of 900
    return replace(compared, error=compared.error * _wider(probability))


def _wider(probability: float) -> float:
    """Factor by which the allowed deviation of the worst of many taxels is larger than that of one taxel, at the same
    false-alarm rate.

    ``probability`` is the false-alarm rate of each taxel relative to that of all taxels together.
    """
    from scipy.stats import norm

    limit = norm.sf(MOST_DEVIATIONS)
    return float(norm.isf(limit * probability) / MOST_DEVIATIONS)


def _array(rows: int, columns: int) -> Scene:
    """Scene of an array of photo-reflectors under a wide white plate."""
    import mitsuba as mi

    from mitsuba_taxel.backend import activate_variant

    activate_variant()
    reflectors = PhotoReflector(rows=rows, columns=columns, led=AnnularLed(law="lambertian")).to_dict()
    above = mi.ScalarTransform4f().translate([0, 0, 0.8]).scale([70, 70, -1])
    plate = {"type": "rectangle", "to_world": above, "bsdf": Wall("lambertian", 1.0).to_dict()}
    return Scene({"type": "scene", "integrator": {"type": "taxel_tracer"}, "r": reflectors, "plate": plate})


def _billion() -> ComparedReading:
    """Compare a reading of 2^30 paths with a reading of fewer paths. The remark states the error that a running sum in
    single precision would have."""
    long = read(_array(8, 4), points=POINTS_OF_A_BILLION, seed=1)
    short = read(_array(8, 4), points=1 << 16, seed=2)
    remark = f"a running single-precision sum of as many is off by {running_sum_error(1 << 30):.0%}"
    return _compared(long, short, "65536 points", remark, rounding=ROUNDING)


def running_sum_error(count: int) -> float:
    """Relative error of a running sum of ``count`` random numbers of mean 1 in single precision."""
    numbers = np.random.default_rng(0).exponential(size=1 << 22).astype(np.float32)
    total, blocks = np.float32(0), count // len(numbers)
    for _ in range(blocks):
        numbers[0], first = numbers[0] + total, numbers[0]
        total = np.add.accumulate(numbers, dtype=np.float32)[-1]
        numbers[0] = first
    return float(1 - total / (blocks * numbers.sum(dtype=np.float64)))
