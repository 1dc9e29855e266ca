"""Set-up of Mitsuba: selection of LLVM and variant, registration of plugins.

Input: the name of a variant, or none for the default variant. Output: Mitsuba with an LLVM that loads, in that variant,
which knows the plugins of this package.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from mitsuba_taxel.backend.llvm import check_llvm, choose_llvm, load_drjit
from mitsuba_taxel.backend.registry import (
    DEFAULT_VARIANT,
    SUPPORTED_VARIANTS,
    activate_variant,
    check_backend,
    default_variant,
    plugin_files,
    plugin_kind,
    register_for_every_variant,
    wanted_variant,
    work_of_processor,
)
from mitsuba_taxel.backend.turns import in_turn
from mitsuba_taxel.base.caches import kept

__all__ = [
    "DEFAULT_VARIANT",
    "SUPPORTED_VARIANTS",
    "activate_variant",
    "check_backend",
    "check_llvm",
    "choose_llvm",
    "default_variant",
    "in_turn",
    "load_drjit",
    "plugin_files",
    "plugin_kind",
    "register_for_every_variant",
    "report",
    "versions",
    "wanted_variant",
    "work_of_processor",
]


def report() -> dict[str, object]:
    """Versions, the LLVM in use, variants and plugins of this installation.

    Returns
    -------
    dict[str, object]
        ``versions``, by name; ``llvm``, with ``path`` and ``version``; ``card``, whether Dr.Jit finds a graphics card;
        ``variant`` that is used; ``variants`` that the plugins of this package support; ``plugins``, their sorted
        names.
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
        "card": "NVIDIA, with a driver" if dr.has_backend(dr.JitBackend.CUDA) else "none",
        "variant": wanted_variant(),
        "variants": [variant for variant in mi.variants() if variant in SUPPORTED_VARIANTS],
        "plugins": sorted(plugin_files()),
    }


@kept(None)
def versions() -> Mapping[str, str]:
    """Versions of Python, this package and the packages that it uses, by name; read once in a process."""
    import importlib.metadata
    import platform

    packages = ("mitsuba_taxel", "mitsuba", "drjit", "numpy", "scipy")
    installed = {"python": platform.python_version()}
    for name in (*packages, "netgen-mesher", "rslab", "trimesh", "pytetwild", "meshio", "xarray"):
        try:
            installed[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            installed[name] = "not installed"
    return MappingProxyType(installed)
