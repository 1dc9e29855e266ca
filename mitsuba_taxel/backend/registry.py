"""Registration of the plugins of this package with Mitsuba, in every variant.

A plugin is a file ``plugins/<kind>/<name>.py`` with a class whose name is that of the file in CamelCase. The class
derives from a type of the current variant, so an imported file is reloaded at each change of variant.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Callable
from pathlib import Path

from mitsuba_taxel.backend.llvm import check_llvm, remedy
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
    """Files of the plugins by name, without importing them; the folder of a file is the kind of plugin."""
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
        Name of the plugin.

    Returns
    -------
    str
        Name of the XML element.
    """
    return plugin_files()[name].parent.name.removesuffix("s")


def register_for_every_variant() -> None:
    """Register the plugins for the current variant, if there is one, and for each variant that is set later."""
    import mitsuba as mi

    from mitsuba_taxel.backend.libraries import put_own_libraries_first

    put_own_libraries_first(mi.file_resolver())
    # Mitsuba looks up the kind of a plugin in `scalar_rgb`; it may merge plugins of unknown kind, or not write them as
    # XML.
    for name, file in plugin_files().items():
        getattr(mi.scalar_rgb, _REGISTER[file.parent.name])(name, _refusal(name, "scalar_rgb"))
    mi.detail.add_variant_callback(_on_variant_change)
    if mi.variant() is not None:
        _register_plugins(mi.variant())


def wanted_variant() -> str:
    """The variant in ``MITSUBA_TAXEL_VARIANT``, or :data:`DEFAULT_VARIANT` if that is not set.

    Returns
    -------
    str
        Name of a variant, which need not exist.
    """
    return os.environ.get("MITSUBA_TAXEL_VARIANT") or DEFAULT_VARIANT


def default_variant() -> str:
    """The variant that is used unless the user sets another variant; raises `InputError` if it is not supported."""
    variant = wanted_variant()
    if variant not in SUPPORTED_VARIANTS:
        allowed = ", ".join(SUPPORTED_VARIANTS)
        raise InputError(f"MITSUBA_TAXEL_VARIANT = {variant!r} is not allowed: one of {allowed} is needed.")
    return variant


def activate_variant() -> str:
    """The current variant; sets the default variant if none is set.

    Returns
    -------
    str
        Name of the variant in use.
    """
    import mitsuba as mi

    if mi.variant() is None:
        variant = default_variant()
        check_backend(variant)
        mi.set_variant(variant)
    return mi.variant()


def check_backend(variant: str) -> None:
    """Raise if this machine lacks what a variant needs.

    Parameters
    ----------
    variant : str
        Name of a variant of Mitsuba.

    Raises
    ------
    ImportError
        in one line, if Dr.Jit finds no graphics card or driver for a variant of CUDA, or no LLVM for one of LLVM.
    """
    import drjit as dr

    if variant.startswith("cuda") and not dr.has_backend(dr.JitBackend.CUDA):
        raise ImportError(
            f"the variant {variant} needs an NVIDIA card and its driver, and Dr.Jit finds none: {DEFAULT_VARIANT} uses "
            "the processor."
        )
    if variant.startswith("llvm") and not dr.has_backend(dr.JitBackend.LLVM):
        raise ImportError(f"the variant {variant} needs LLVM, and Dr.Jit finds none: {remedy()}.")


def work_of_processor(variant: str) -> str | None:
    """A sentence that says which computations run on the CPU even in a variant for graphics cards.

    Parameters
    ----------
    variant : str
        Name of a variant of Mitsuba.

    Returns
    -------
    str or None
        The sentence; None for a variant that does not use a graphics card.
    """
    if not variant.startswith("cuda"):
        return None
    return (
        "Random paths are followed on the graphics card; finite elements, and light without random numbers, are "
        "computed on the processor."
    )


def _on_variant_change(old: str | None, new: str) -> None:
    if old != new:
        _register_plugins(new)


def _register_plugins(variant: str) -> None:
    """Register the plugins for a variant; in an unsupported variant they raise an error when they are used."""
    import mitsuba as mi

    check_llvm(variant)
    for name, file in plugin_files().items():
        kind = file.parent.name
        plugin = _made(f"{_PACKAGE}.{kind}.{name}") if variant in SUPPORTED_VARIANTS else _refusal(name, variant)
        getattr(mi, _REGISTER[kind])(name, plugin)


def _made(module: str) -> Callable[..., object]:
    """Create the constructor of a plugin. The constructor imports the module of the plugin at its first call. A module
    that is imported already is reloaded at once.
    """
    name = "".join(word.capitalize() for word in module.rpartition(".")[2].split("_"))
    if module in sys.modules:
        importlib.reload(sys.modules[module])

    def make(props: object) -> object:
        return getattr(importlib.import_module(module), name)(props)

    return make


def _refusal(name: str, variant: str) -> Callable[..., object]:
    """Create a constructor that raises an error, for a plugin in an unsupported variant; the error names the supported
    variants."""

    def refuse(props: object) -> object:
        raise ValueError(
            f"{name} does not work in the variant {variant}: allowed are {', '.join(SUPPORTED_VARIANTS)} "
            "(one narrow band in the near infrared; scalar variants are slow, spectral ones end at 830 nm)."
        )

    return refuse
