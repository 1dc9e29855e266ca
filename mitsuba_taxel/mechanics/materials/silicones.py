"""Measured silicones by name, and silicones of a given Shore hardness.

The tensile curves of L. Marechal et al., Towards a Common Framework and Database of Materials for Soft Robotics, Soft
Robotics, 2020, doi:10.1089/soro.2019.0115 (their data: github.com/LucMarechal/Soft-Robotics-Materials-Database, Open
Database License) were taken by ASTM D412 at 450 mm/min, strain from the crosshead. The constants of all 19 silicones
are our linear least-squares fit of an incompressible Yeoh law with two terms to the nominal stress up to 50 % of
nominal strain. No source gives Poisson's ratio: it is the default, 0.49, which
``silicone(name).changed(poisson_ratio=0.5)`` changes.
"""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.materials.laws import Material, NeoHookean, Yeoh
from mitsuba_taxel.parameters import Number

HARDNESS = Number(
    name="hardness", unit="Shore A", doc="Hardness, from which the modulus is estimated.", minimum=20, maximum=80
)


@dataclass(frozen=True)
class Silicone(Displayed):
    """A silicone's law with its source and range of validity.

    Parameters
    ----------
    material : Material
        The law.
    source : str
        Publication or data, and the method of the fit.
    max_strain : float, optional
        Largest nominal tensile strain of the fit; ``None`` if only a modulus at small strain is known.
    """

    material: Material
    source: str
    max_strain: float | None = None


def _fitted(c10: float, c20: float, misfit: float) -> Silicone:
    """Create a silicone from a fit of Yeoh's law to a tensile curve of the database. ``misfit`` is relative to the
    largest stress in the fit."""
    source = (
        "Yeoh law fitted to the tensile curve of Marechal et al., Soft Robotics, 2020, doi:10.1089/soro.2019.0115, "
        f"up to 50 % strain (root-mean-square misfit {misfit:.1%} of the stress there)"
    )
    return Silicone(Yeoh(c10, c20, 0.0), source, max_strain=0.5)


SILICONES: dict[str, Silicone] = {
    "body_double_silk": _fitted(0.050533, 0.013035, 0.005),
    "dragon_skin_10_medium": _fitted(0.02020, 0.00454, 0.016),
    "dragon_skin_20": _fitted(0.05364, 0.01580, 0.008),
    "dragon_skin_30": _fitted(0.08599, 0.01367, 0.008),
    "dragon_skin_fx_pro": _fitted(0.013291, 0.0019088, 0.026),
    "dragon_skin_fx_pro_slacker": _fitted(0.0014842, -0.00010333, 0.079),
    "ecoflex_00_10": _fitted(0.0033925, 0.00043106, 0.070),
    "ecoflex_00_30": _fitted(0.00697, 0.00086, 0.022),
    "ecoflex_00_35_fast": _fitted(0.012441, 0.0015212, 0.023),
    "ecoflex_00_50": _fitted(0.00958, 0.00120, 0.038),
    "mold_star_16_fast": _fitted(0.04040, 0.00399, 0.011),
    "mold_star_20t": _fitted(0.05352, 0.00468, 0.037),
    "platsil_gel_10": _fitted(0.025034, 0.006105, 0.012),
    "psycho_paint": _fitted(0.058202, 0.0045135, 0.036),
    "rebound_25": _fitted(0.047261, 0.0059836, 0.009),
    "rtv_615": _fitted(0.16395, 0.01618, 0.006),
    "soloplast_150318": _fitted(0.031843, 0.0037504, 0.064),
    "sorta_clear_40": _fitted(0.13857, 0.00624, 0.005),
    "wagnersil_20_nf": _fitted(0.052873, 0.010951, 0.011),
    "multiphysics_pad": Silicone(
        NeoHookean(),
        "Multiphysics Simulation for the Optimization of an Optoelectronic-Based Tactile Sensor, section 2.2.2: "
        f"silicone of a material library, Young's modulus {NeoHookean.youngs_modulus:g} MPa",
    ),
}
"""Silicones by name."""


def silicone(name: str) -> Material:
    """Law of the silicone of that name in :data:`SILICONES`, which also gives its source.

    Parameters
    ----------
    name : str
        Name of the silicone, a key of :data:`SILICONES`.

    Returns
    -------
    Material
        Law of the silicone, in MPa.

    Raises
    ------
    InputError
        if there is none of that name.
    """
    if not isinstance(name, str) or name not in SILICONES:
        raise InputError(f"silicone = {name!r} is not allowed: one of {', '.join(SILICONES)} is needed.")
    return SILICONES[name].material


def from_shore_a(hardness: float, poisson_ratio: float = NeoHookean.poisson_ratio) -> NeoHookean:
    """A silicone of given hardness: log10 E = 0.0235 S - 0.6403, with E in MPa.

    Ruess's relation, quoted by K. Larson (Can You Estimate Modulus From Durometer Hardness for Silicones?, Dow white
    paper), for 20 <= S <= 80. It is a rough guide: Dragon Skin 20 and 30, of Shore A 20 and 30 by their maker, were
    measured to be less than half as stiff.

    Parameters
    ----------
    hardness : float
        Hardness S on the Shore A scale, from 20 to 80.
    poisson_ratio : float
        Poisson's ratio, from 0 to 0.5.

    Returns
    -------
    NeoHookean
        Material with its modulus in MPa.

    Raises
    ------
    InputError
        if a number is out of range.
    """
    return NeoHookean(10 ** (0.0235 * HARDNESS.checked(hardness) - 0.6403), poisson_ratio)
