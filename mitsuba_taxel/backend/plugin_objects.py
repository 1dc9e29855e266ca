"""Create Mitsuba objects from within our plugins, and find their plugins' names."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import mitsuba as mi


def make_plugin(name: str, **parameters: Any) -> Any:
    """An object of the plugin ``name``; nested objects are given as such.

    Unlike ``mi.load_dict``, this does not replace Mitsuba's global file resolver, which is unsafe while other threads
    create plugins of the scene (a ``ply`` then reads freed memory).

    Parameters
    ----------
    name : str
        Of the plugin.
    **parameters : Any
        Its properties and nested objects by name.

    Returns
    -------
    Any
        Of the current variant.
    """
    props = mi.Properties(name)
    for key, value in parameters.items():
        props[key] = value
    return mi.PluginManager.instance().create_object(props)


def found(name: str) -> Path:
    """A file named in a scene, looked for beside the scene.

    Parameters
    ----------
    name : str
        As the scene has it.

    Returns
    -------
    Path
        The name itself if there is no such file.
    """
    return Path(str(mi.file_resolver().resolve(name)))


def find_file(props: mi.Properties, name: str, suffix: str) -> None:
    """Let a property that names a file, as its suffix tells, be the path of the one beside the scene.

    Parameters
    ----------
    props : mi.Properties
        Of a plugin.
    name : str
        Of the property.
    suffix : str
        Ending by which its value is the name of a file.
    """
    if name in props and str(props[name]).endswith(suffix):
        props[name] = str(found(props[name]))


def kind_of(made: Any) -> str:
    """The plugin's name: for our plugins from the Python class, for Mitsuba's own from its C++ class.

    Parameters
    ----------
    made : Any
        An object of Mitsuba's.

    Returns
    -------
    str
        As in ``type="..."`` of a scene.
    """
    ours = type(made).__module__ != "mitsuba"
    name = type(made).__name__ if ours else made.class_name()
    name = name.removesuffix("Integrator").removesuffix("Mesh") or "Mesh"
    if not ours and name in _NAMED_OTHERWISE:
        return _NAMED_OTHERWISE[name]
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def element_of(made: Any) -> str:
    """The XML element of an object, such as ``bsdf``; empty if it is none of Mitsuba's.

    Parameters
    ----------
    made : Any
        An object of Mitsuba's.

    Returns
    -------
    str
        Name of the element.
    """
    return next((element for element, kind in _ELEMENTS.items() if isinstance(made, getattr(mi, kind))), "")


def is_nested(props: mi.Properties, name: str) -> bool:
    """Whether a property is a nested object, made or only parsed.

    Parameters
    ----------
    props : mi.Properties
        Of a plugin.
    name : str
        Of the property.

    Returns
    -------
    bool
        Whether it is.
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
"""Plugins of Mitsuba by their classes, where these have other names."""
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
"""Class of the objects of each XML element."""
