"""Set-up of Mitsuba: choice of LLVM and variant, registration of plugins."""

from __future__ import annotations

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
    "wanted_variant",
]


def report() -> dict[str, object]:
    """Versions, the LLVM in use, variants and plugins of this installation.

    Returns a dictionary with the keys ``versions`` (name -> version), ``llvm`` (``path``, ``version``),
    ``variants`` (those our plugins work in), and ``plugins`` (sorted names).
    """
    import importlib.metadata
    import os
    import platform

    import drjit as dr
    import mitsuba as mi

    ours = ("mitsuba_taxel", "mitsuba", "drjit", "numpy", "scipy")
    names = (*ours, "netgen-mesher", "rslab", "trimesh", "pytetwild", "meshio", "xarray")
    versions = {"python": platform.python_version()}
    for name in names:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = "not installed"
    version = dr.detail.llvm_version()
    return {
        "versions": versions,
        "llvm": {
            "path": os.environ.get("DRJIT_LIBLLVM_PATH", "found by Dr.Jit"),
            "version": ".".join(map(str, version)) if version and version[0] > 0 else "none",
        },
        "variants": [variant for variant in mi.variants() if variant in SUPPORTED_VARIANTS],
        "plugins": sorted(plugin_files()),
    }
