"""Register our plugins with Mitsuba, in every variant.

A plugin is a file ``plugins/<kind>/<name>.py`` holding a class whose name is the file's in CamelCase. Its class derives
from a type of the current variant, so a file that has been imported is reloaded at each change of variant.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Callable
from pathlib import Path

from mitsuba_taxel.backend.llvm import check_llvm
from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import InputError

DEFAULT_VARIANT = "llvm_ad_mono"
SUPPORTED_VARIANTS = ("llvm_ad_mono", "llvm_ad_rgb", "cuda_ad_mono", "cuda_ad_rgb")
_PACKAGE = "mitsuba_taxel.plugins"
_REGISTER = {
    "emitters": "register_emitter",
    "sensors": "register_sensor",
    "bsdfs": "register_bsdf",
    "integrators": "register_integrator",
    "samplers": "register_sampler",
    "shapes": "register_shape",
}


@kept(None)
def plugin_files() -> dict[str, Path]:
    """Plugin name -> its file (the folder is the kind of plugin), without importing any."""
    spec = importlib.util.find_spec(_PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise ImportError(f"{_PACKAGE} is not installed: install the project with pip.")
    return {
        file.stem: file
        for folder in map(Path, spec.submodule_search_locations)
        for kind in _REGISTER
        for file in sorted((folder / kind).glob("[a-z]*.py"))
    }


def plugin_kind(name: str) -> str:
    """Kind of a plugin of this package, such as ``bsdf``.

    Parameters
    ----------
    name : str
        Of the plugin.

    Returns
    -------
    str
        As of the XML element.
    """
    return plugin_files()[name].parent.name.removesuffix("s")


def register_for_every_variant() -> None:
    """Register the plugins for the current variant, if any, and for each that will be set later."""
    import mitsuba as mi

    from mitsuba_taxel.backend.libraries import put_own_libraries_first

    put_own_libraries_first(mi.file_resolver())
    # Mitsuba looks up the kind of a plugin in `scalar_rgb`; unknown ones it may merge, or not write as XML.
    for name, file in plugin_files().items():
        getattr(mi.scalar_rgb, _REGISTER[file.parent.name])(name, _refusal(name, "scalar_rgb"))
    mi.detail.add_variant_callback(_on_variant_change)
    if mi.variant() is not None:
        _register_plugins(mi.variant())


def wanted_variant() -> str:
    """The variant that ``MITSUBA_TAXEL_VARIANT`` names, whether it exists or not, or else :data:`DEFAULT_VARIANT`.

    Returns
    -------
    str
        Name of a variant.
    """
    return os.environ.get("MITSUBA_TAXEL_VARIANT") or DEFAULT_VARIANT


def default_variant() -> str:
    """The variant used unless the user sets one: ``MITSUBA_TAXEL_VARIANT``, or else :data:`DEFAULT_VARIANT`."""
    variant = wanted_variant()
    if variant not in SUPPORTED_VARIANTS:
        allowed = ", ".join(SUPPORTED_VARIANTS)
        raise InputError(f"MITSUBA_TAXEL_VARIANT = {variant!r} is not allowed: one of {allowed} is needed.")
    return variant


def activate_variant() -> str:
    """The current variant; sets the default if the user has set none.

    Returns
    -------
    str
        Name of the variant in use.
    """
    import mitsuba as mi

    if mi.variant() is None:
        mi.set_variant(default_variant())
    return mi.variant()


def _on_variant_change(old: str | None, new: str) -> None:
    if old != new:
        _register_plugins(new)


def _register_plugins(variant: str) -> None:
    import mitsuba as mi

    check_llvm(variant)
    for name, file in plugin_files().items():
        kind = file.parent.name
        plugin = _made(f"{_PACKAGE}.{kind}.{name}") if variant in SUPPORTED_VARIANTS else _refusal(name, variant)
        getattr(mi, _REGISTER[kind])(name, plugin)


def _made(module: str) -> Callable[..., object]:
    """A plugin's class, which is imported when the first scene holds it; at once if another variant's has been."""
    name = "".join(word.capitalize() for word in module.rpartition(".")[2].split("_"))
    if module in sys.modules:
        importlib.reload(sys.modules[module])

    def make(props: object) -> object:
        return getattr(importlib.import_module(module), name)(props)

    return make


def _refusal(name: str, variant: str) -> Callable[..., object]:
    def refuse(props: object) -> object:
        raise ValueError(
            f"{name} does not work in the variant {variant}: allowed are {', '.join(SUPPORTED_VARIANTS)} "
            "(one narrow band in the near infrared; scalar variants are slow, spectral ones end at 830 nm)."
        )

    return refuse
