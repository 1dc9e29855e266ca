"""Irradiance maps as OpenEXR files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.sensing import Readings


def write_irradiance(readings: Readings, file: Path) -> None:
    """Write the irradiance map of readings as an OpenEXR file: one channel ``irradiance`` in W/mm2, with a block of
    pixels for each taxel.

    The header holds ``units``, ``seed``, ``points``, ``replicates`` and, as JSON, ``parameters``.

    Parameters
    ----------
    readings : Readings
        Readings with a map.
    file : Path
        OpenEXR file, which is replaced if it exists.

    Raises
    ------
    InputError
        if the readings have no map.
    """
    import OpenEXR

    if readings.irradiance is None:
        raise InputError("these readings hold no irradiance map: measure with irradiance=True.")
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "units": "irradiance in W/mm2",
        "seed": str(readings.seed),
        "points": str(readings.points),
        "replicates": str(len(readings.replicates)),
        "parameters": json.dumps(readings.parameters),
    }
    pixels = np.ascontiguousarray(readings.irradiance, dtype=np.float32)
    with replacing(file) as temporary, OpenEXR.File(header, {"irradiance": pixels}) as image:
        image.write(str(temporary))
