"""The circuit that reads a phototransistor, as a table of numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.arguments import path_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.toml import read_toml
from mitsuba_taxel.parameters import REQUIRED, Checked, Number, number, parameter_field, values_of, whole

ROOM_TEMPERATURE = 25.0
"""Temperature in degrees C to which datasheets refer."""
ZERO_CELSIUS = 273.15
MOST_DECADES = 100
"""Largest number of decades by which the dark current may rise with temperature."""
BOLTZMANN = 1.380649e-23
"""In J/K."""
CHARGE = 1.602176634e-19
"""Elementary charge, in A s."""


@dataclass(frozen=True, kw_only=True)
class _Resistance(Number):
    """A resistance in Ohm; infinite for an open circuit."""

    def checked(self, value: Any) -> float:
        return math.inf if isinstance(value, float) and value == math.inf else super().checked(value)


@dataclass(frozen=True)
class Circuit(Checked):
    """A phototransistor as emitter follower on a load resistor, a buffer and an analogue-digital converter.

    All taxels have the same circuit. Values are those at 25 degrees C, as in datasheets.

    Raises
    ------
    InputError
        if a value is not allowed, or the circuit cannot work.
    """

    supply: float = number(REQUIRED, "V", "Supply voltage of phototransistor, buffer and converter.", above=0)
    load_resistance: float = parameter_field(
        _Resistance(
            default=REQUIRED,
            unit="Ohm",
            doc="Load resistance from the emitter to ground; `inf` for an open emitter.",
            minimum=0,
        )
    )
    transfer: float = number(
        REQUIRED, "A/W", "Photocurrent per optical power that reaches the phototransistor, its gain included.", above=0
    )
    led_current: float | None = number(
        None,
        "A",
        "Current of each LED. The power of a scene's LEDs is then only a relative factor, 1 by default.",
        minimum=0,
        default_words="none: LEDs emit the power of the scene",
    )
    led_efficiency: float | None = number(
        REQUIRED, "W/A", "Optical power per current of an LED.", above=0, needs="led_current"
    )
    led_drift: float = number(0.0, "1/K", "Relative change of the LED's power with temperature.")
    transfer_drift: float = number(0.0, "1/K", "Relative change of `transfer` with temperature.")
    saturation_voltage: float = number(
        0.1,
        "V",
        "Collector-emitter voltage at which the phototransistor passes half of its photocurrent; with 0 it passes all "
        "of it down to 0 V.",
        minimum=0,
    )
    dark_current: float = number(0.0, "A", "Current of the phototransistor without light.", minimum=0)
    dark_decade: float = number(23.0, "K", "Rise of temperature for a tenfold dark current.", above=0)
    temperature: float = number(ROOM_TEMPERATURE, "degrees C", "Temperature of all parts.", minimum=-200, maximum=500)
    buffer_gain: float = number(1.0, "", "Voltage gain of the buffer, whose output is limited to the supply.", above=0)
    adc_bits: int = whole(12, 1, 24, "Resolution of the converter.")
    adc_reference: float | None = number(
        None, "V", "Voltage of the converter's full scale.", above=0, default_words="the supply"
    )
    bandwidth: float = number(1000.0, "Hz", "-3 dB bandwidth of a first-order low pass before the converter.", above=0)
    current_gain: float = number(
        0.0,
        "",
        "Current gain of the phototransistor, which amplifies the shot noise of its base current. With 0, only the "
        "shot noise of the photocurrent counts.",
        minimum=0,
    )
    flicker_noise: float = number(0.0, "V", "1/f noise at the converter, at 1 Hz and in 1 Hz.", minimum=0)
    flicker_from: float = number(
        0.1, "Hz", "Lowest frequency of 1/f noise: one over the duration of a recording.", above=0
    )
    other_noise: float = number(
        0.0, "V", "Other noise at the converter, of supply, buffer and converter; one standard deviation.", minimum=0
    )

    def _check(self) -> None:
        if self.saturation_voltage >= self.supply:
            raise InputError(
                f"saturation_voltage = {self.saturation_voltage:g} is not allowed: less than supply = {self.supply:g} "
                "is needed, or the circuit cannot work."
            )
        if (self.temperature - ROOM_TEMPERATURE) / self.dark_decade > MOST_DECADES:
            raise InputError(
                f"dark_decade = {self.dark_decade:g} is not allowed at temperature = {self.temperature:g}: at most "
                f"{MOST_DECADES} decades above the dark current are possible; a larger dark_decade is needed."
            )
        for name in ("led_drift", "transfer_drift"):
            if self._grown(getattr(self, name)) <= 0:
                raise InputError(
                    f"{name} = {getattr(self, name):g} is not allowed at temperature = {self.temperature:g}: the "
                    f"current would not be above 0; a drift closer to 0 is needed."
                )

    def _grown(self, drift: float) -> float:
        """Factor by which a quantity with a relative ``drift`` per K changes from 25 degrees C to `temperature`."""
        return 1 + drift * (self.temperature - ROOM_TEMPERATURE)

    @property
    def current_per_power(self) -> float:
        """Photocurrent in A per W of reading, at the LED current and the temperature of the circuit."""
        emitted = 1.0 if self.led_current is None else self.led_current * (self.led_efficiency or 0.0)
        return emitted * self._grown(self.led_drift) * self.transfer * self._grown(self.transfer_drift)

    @property
    def leakage(self) -> float:
        """Dark current of the phototransistor at the circuit's temperature, in A."""
        return self.dark_current * 10 ** ((self.temperature - ROOM_TEMPERATURE) / self.dark_decade)

    @property
    def thermal_voltage(self) -> float:
        """Thermal voltage k T / q of the phototransistor's junctions, in V."""
        return BOLTZMANN * self.kelvin / CHARGE

    @property
    def kelvin(self) -> float:
        """The temperature of the circuit, in K."""
        return self.temperature + ZERO_CELSIUS

    @property
    def full_scale(self) -> float:
        """Voltage of the converter's largest count, in V."""
        return self.supply if self.adc_reference is None else self.adc_reference

    @property
    def step(self) -> float:
        """Voltage of one count of the converter, in V."""
        return self.full_scale / 2**self.adc_bits

    @property
    def limit(self) -> float:
        """Output in V above which the circuit counts as saturated.

        It is the smallest of three voltages: the converter's full scale, the supply, and the output at which the
        phototransistor passes half of its photocurrent.
        """
        return min(self.full_scale, self.supply, self.buffer_gain * (self.supply - self.saturation_voltage))

    def as_table(self) -> dict[str, Any]:
        """The circuit as a table of a study file.

        Returns
        -------
        dict[str, Any]
            Values of the parameters by name.
        """
        return values_of(self)


def circuit_of(table: object) -> Circuit:
    """The circuit described by a table of a TOML file.

    Parameters
    ----------
    table : object
        Values of the parameters of :class:`Circuit` by name.

    Returns
    -------
    Circuit
        Parameters that the table leaves out have their defaults.

    Raises
    ------
    InputError
        if it is not such a table, or a value is not allowed.
    """
    if not isinstance(table, Mapping):
        raise InputError(f"circuit = {table!r} is not allowed: a table [circuit] of numbers is needed.")
    allowed = [field.name for field in fields(Circuit)]
    for name in table:
        if name not in allowed:
            raise InputError(f"circuit: {name} is not known: allowed are {', '.join(sorted(allowed))}.")
    return Circuit(**table)


def read_circuit(file: str | Path) -> Circuit:
    """The circuit in a TOML file, at top level or in a table ``[circuit]`` as in a study file.

    Parameters
    ----------
    file : str or Path
        The TOML file.

    Returns
    -------
    Circuit
        Parameters that the file leaves out have their defaults.

    Raises
    ------
    InputError
        if the file cannot be read, or does not describe a circuit.
    """
    file = path_of("circuit", file)
    content = read_toml(f"circuit {str(file)!r}", file)
    return circuit_of(content.get("circuit", content))
