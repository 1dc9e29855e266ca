"""Set-up of Mitsuba: choice of LLVM and variant, registration of plugins."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from mitsuba_taxel.backend.llvm import check_llvm, choose_llvm
from mitsuba_taxel.backend.registry import (
    DEFAULT_VARIANT,
    SUPPORTED_VARIANTS,
    activate_variant,
    default_variant,
    plugin_files,
    plugin_kind,
    register_for_every_variant,
    wanted_variant,
)
from mitsuba_taxel.backend.turns import in_turn
from mitsuba_taxel.base.caches import kept

__all__ = [
    "DEFAULT_VARIANT",
    "SUPPORTED_VARIANTS",
    "activate_variant",
    "check_llvm",
    "choose_llvm",
    "default_variant",
    "in_turn",
    "plugin_files",
    "plugin_kind",
    "register_for_every_variant",
    "report",
    "versions",
    "wanted_variant",
]


def report() -> dict[str, object]:
    """Versions, the LLVM in use, variants and plugins of this installation.

    Returns a dictionary with the keys ``versions`` (name -> version), ``llvm`` (``path``, ``version``),
    ``variants`` (those our plugins work in), and ``plugins`` (sorted names).
    """
    import os

    import drjit as dr
    import mitsuba as mi

    version = dr.detail.llvm_version()
    return {
        "versions": dict(versions()),
        "llvm": {
            "path": os.environ.get("DRJIT_LIBLLVM_PATH", "found by Dr.Jit"),
            "version": ".".join(map(str, version)) if version and version[0] > 0 else "none",
        },
        "variants": [variant for variant in mi.variants() if variant in SUPPORTED_VARIANTS],
        "plugins": sorted(plugin_files()),
    }


@kept(None)
def versions() -> Mapping[str, str]:
    """Versions of Python, this package and what it computes with, by name; read once in a process."""
    import importlib.metadata
    import platform

    ours = ("mitsuba_taxel", "mitsuba", "drjit", "numpy", "scipy")
    found = {"python": platform.python_version()}
    for name in (*ours, "netgen-mesher", "rslab", "trimesh", "pytetwild", "meshio", "xarray"):
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed"
    return MappingProxyType(found)
