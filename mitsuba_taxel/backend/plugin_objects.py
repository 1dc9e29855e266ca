"""Creation of Mitsuba objects in plugins of this package, and names of the plugins of objects."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import mitsuba as mi


def make_plugin(name: str, **parameters: Any) -> Any:
    """Create an object of a plugin.

    Unlike ``mi.load_dict``, this does not replace Mitsuba's global file resolver, which is unsafe while other threads
    create plugins of the scene (a ``ply`` then reads freed memory).

    Parameters
    ----------
    name : str
        Name of the plugin.
    **parameters : Any
        Properties and nested objects by name.

    Returns
    -------
    Any
        Object in the current variant.
    """
    props = mi.Properties(name)
    for key, value in parameters.items():
        props[key] = value
    return mi.PluginManager.instance().create_object(props)


def resolved_path(name: str) -> Path:
    """Path of a file whose name in a scene is relative to the scene.

    Parameters
    ----------
    name : str
        Name in the scene.

    Returns
    -------
    Path
        The name itself if there is no such file beside the scene.
    """
    return Path(str(mi.file_resolver().resolve(name)))


def find_file(props: mi.Properties, name: str, suffix: str) -> None:
    """Replace a property that is the name of a file by its path; see `resolved_path`.

    Parameters
    ----------
    props : mi.Properties
        Properties of a plugin.
    name : str
        Name of the property.
    suffix : str
        Suffix of file names; values without it are not changed.
    """
    if name in props and str(props[name]).endswith(suffix):
        props[name] = str(resolved_path(props[name]))


def kind_of(instance: Any) -> str:
    """Name of the plugin of an object, from its Python class or, for plugins of Mitsuba, from its C++ class.

    Parameters
    ----------
    instance : Any
        An object of Mitsuba.

    Returns
    -------
    str
        Name, as in ``type="..."`` of a scene.
    """
    ours = type(instance).__module__ != "mitsuba"
    name = type(instance).__name__ if ours else instance.class_name()
    name = name.removesuffix("Integrator").removesuffix("Mesh") or "Mesh"
    if not ours and name in _NAMED_OTHERWISE:
        return _NAMED_OTHERWISE[name]
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def element_of(instance: Any) -> str:
    """The XML element of an object, such as ``bsdf``.

    Parameters
    ----------
    instance : Any
        Any object.

    Returns
    -------
    str
        Name of the element; empty if it is not an object of Mitsuba.
    """
    return next((element for element, kind in _ELEMENTS.items() if isinstance(instance, getattr(mi, kind))), "")


def is_nested(props: mi.Properties, name: str) -> bool:
    """Whether a property is a nested object, created or only parsed.

    Parameters
    ----------
    props : mi.Properties
        Properties of a plugin.
    name : str
        Name of the property.

    Returns
    -------
    bool
        True for objects and references to objects.
    """
    kinds = mi.Properties.Type
    return props.type(name) in (kinds.Object, kinds.Reference, kinds.ResolvedReference)


_NAMED_OTHERWISE = {
    "AreaLight": "area",
    "ConstantBackgroundEmitter": "constant",
    "DirectionalArea": "directionalarea",
    "DirectionalEmitter": "directional",
    "EnvironmentMapEmitter": "envmap",
    "PointLight": "point",
    "SpotLight": "spot",
    "SmoothConductor": "conductor",
    "SmoothDielectric": "dielectric",
    "SmoothDiffuse": "diffuse",
    "SmoothPlastic": "plastic",
    "RoughConductor": "roughconductor",
    "RoughDielectric": "roughdielectric",
    "RoughPlastic": "roughplastic",
    "ThinDielectric": "thindielectric",
    "TwoSidedBRDF": "twosided",
    "BumpMap": "bumpmap",
    "NormalMap": "normalmap",
    "MaskBSDF": "mask",
    "BlendBSDF": "blendbsdf",
}
"""Plugins of Mitsuba by the names of their classes, where these differ from the plugin's name."""
_ELEMENTS = {
    "integrator": "Integrator",
    "shape": "Shape",
    "bsdf": "BSDF",
    "emitter": "Emitter",
    "sensor": "Sensor",
    "film": "Film",
    "rfilter": "ReconstructionFilter",
    "sampler": "Sampler",
    "texture": "Texture",
    "medium": "Medium",
    "phase": "PhaseFunction",
    "volume": "Volume",
}
"""Class in Mitsuba of the objects of each XML element."""
