"""The optical parts of a sensor as Python objects: walls, LEDs, phototransistors.

They say what the plugins of the same names say, in the same words. What is None is left to the plugin. What is not of
the right kind is refused at once (`InputError`), a value that is not allowed when the scene is loaded.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from mitsuba_taxel.base.arguments import check_fields


@dataclass(frozen=True)
class Wall:
    """A wall of a cell, a plate or a package, as the plugin `wall`.

    Parameters
    ----------
    scattering : mirror, lambertian, isotropic, absorbing, mixed or rough_mirror
    reflectance : share of the light that comes back, 0 to 1
    reflectance_table : instead of it, a CSV file of wavelength in nm and reflectance
    specular, lambertian, isotropic : shares of the reflected light of a mixed wall, of sum 1
    rms_slope : root mean square slope of a rough mirror, in degrees
    """

    scattering: str = "lambertian"
    reflectance: float | None = None
    reflectance_table: str | None = None
    specular: float | None = None
    lambertian: float | None = None
    isotropic: float | None = None
    rms_slope: float | None = None

    def __post_init__(self) -> None:
        check_fields(self)

    def to_dict(self) -> dict[str, Any]:
        """The plugin as a Mitsuba dictionary."""
        return {"type": "wall", **_given(self)}


ABSORBING = Wall("absorbing")
ISOTROPIC = Wall("isotropic")


@dataclass(frozen=True)
class AnnularLed:
    """What each LED emits, as the plugin `annular_led`.

    Parameters
    ----------
    power : W
    shape : square or circular
    size, hole : sides or diameters in mm of the emitting area and of its dark centre
    wavelength : nm
    law : uniform_solid_angle, uniform_polar_angle, lambertian, cosine_power or tabulated
    cone_angle : half-angle of the two uniform laws, in degrees
    exponent : of the law cosine_power
    file : of the law tabulated: CSV of degrees and relative radiant intensity
    """

    power: float | None = None
    shape: str | None = None
    size: float | None = None
    hole: float | None = None
    wavelength: float | None = None
    law: str | None = None
    cone_angle: float | None = None
    exponent: float | None = None
    file: str | None = None

    def __post_init__(self) -> None:
        check_fields(self)

    def to_dict(self) -> dict[str, Any]:
        """The plugin as a Mitsuba dictionary."""
        return {"type": "annular_led", **_given(self)}


@dataclass(frozen=True)
class Phototransistor:
    """What each phototransistor responds to, as the plugin `phototransistor`.

    Parameters
    ----------
    width, depth : extent in mm along x and y
    response : ideal, cosine_power or tabulated
    exponent : of the response cosine_power
    file : of the response tabulated: CSV of degrees and relative response
    quantum_efficiency : 0 to 1
    """

    width: float | None = None
    depth: float | None = None
    response: str | None = None
    exponent: float | None = None
    file: str | None = None
    quantum_efficiency: float | None = None

    def __post_init__(self) -> None:
        check_fields(self)

    def to_dict(self) -> dict[str, Any]:
        """The plugin as a Mitsuba dictionary."""
        return {"type": "phototransistor", **_given(self)}


@dataclass(frozen=True)
class PhotoReflector:
    """An array of photo-reflectors, as the plugin `photo_reflector`; the defaults are those of the NJL5908AR.

    Parameters
    ----------
    rows, columns, pitch : the array and the distance between neighbours in mm
    spacing : distance in mm between the centres of LED and phototransistor, along x
    led, phototransistor : one of each, repeated in every body
    body : wall of the package around the two
    """

    rows: int = 1
    columns: int = 1
    pitch: float = 3.55
    spacing: float = 0.9
    led: AnnularLed = field(default_factory=AnnularLed)
    phototransistor: Phototransistor = field(default_factory=Phototransistor)
    body: Wall = ABSORBING

    def __post_init__(self) -> None:
        check_fields(
            self,
            led=(AnnularLed, "an AnnularLed"),
            phototransistor=(Phototransistor, "a Phototransistor"),
            body=(Wall, "a Wall"),
        )

    def to_dict(self) -> dict[str, Any]:
        """The plugin, with its LED and phototransistor, as a Mitsuba dictionary."""
        return {
            "type": "photo_reflector",
            "rows": self.rows,
            "columns": self.columns,
            "pitch": self.pitch,
            "spacing": self.spacing,
            "led": self.led.to_dict(),
            "phototransistor": self.phototransistor.to_dict(),
            "body_wall": self.body.to_dict(),
        }


def _given(part: Any) -> dict[str, Any]:
    """The fields of a part that are not left to the plugin."""
    return {name: value for name, value in asdict(part).items() if value is not None}
