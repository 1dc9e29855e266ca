"""Changes to the pads of a parsed scene before they are built: order, packages, meshes and loads."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mitsuba_taxel.base.errors import InputError

if TYPE_CHECKING:
    import mitsuba as mi


def pads_of(state: mi.parser.ParserState) -> list[mi.Properties]:
    """Properties of the pads of a parsed scene."""
    return [node.props for node in state.nodes if node.props.plugin_name() == "deformable_pad"]


def build_pads_last(state: mi.parser.ParserState) -> None:
    """Move the pads of a parsed scene behind all other objects, so that errors in these are reported before a pad is
    solved."""
    import mitsuba as mi

    root = state.nodes[0].props
    for name in [name for name in root.keys() if root.type(name) == mi.Properties.Type.ResolvedReference]:  # noqa: SIM118
        reference = root[name]
        if state.nodes[reference.index()].props.plugin_name() == "deformable_pad":
            del root[name]
            root[name] = reference


def announce_packages(state: mi.parser.ParserState) -> None:
    """Mark the pads of a scene with packages, so that they are not deformed before `heed_packages` is called."""
    import mitsuba as mi

    from mitsuba_taxel.kernels.protocols import AWAITED_PACKAGE

    if any(node.props.plugin_name() == "photo_reflector" for node in state.nodes):
        for pad in [pad for pad in pads_of(state) if AWAITED_PACKAGE not in pad]:  # if it is, the pad refuses it
            pad[AWAITED_PACKAGE] = mi.Properties("photo_reflector")


def move_meshes(pads: list[mi.Properties], origins: list[mi.Properties]) -> None:
    """Give pads of built-in shapes the meshes of other pads (``origins``), moved to their own dimensions, instead of
    new meshes.
    """
    from mitsuba_taxel.pads import Pad
    from mitsuba_taxel.specification.deformable_pad import DeformablePad

    built = [pair for pair in zip(pads, origins, strict=True) if "filename" not in pair[0]]
    if not built:
        raise InputError("the scene holds no pad whose mesh can be moved: a deformable_pad without filename is needed.")
    for props, origin_props in built:
        pad, origin = (DeformablePad.read(read).build_pad() for read in (props, origin_props))
        assert isinstance(pad, Pad) and isinstance(origin, Pad)
        props["meshed_as"] = pad.moved_from(origin).meshed_as


def take_load(props: mi.Properties) -> tuple[tuple[float, ...], tuple[list[float], list[tuple[float, ...]]]]:
    """Remove the load and the load history of a pad, and return the value of the load, and times and values of the
    history."""
    from mitsuba_taxel.mechanics.elements.loads import Load
    from mitsuba_taxel.specification.deformable_pad import DeformablePad

    specification = DeformablePad.read(props)
    for name in (*Load.named(specification.load).quantities(), "history"):
        if name in props:
            del props[name]
    return specification.load_value, specification.build_history()
