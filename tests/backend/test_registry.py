"""Plugins are known in every variant, in any order."""

from __future__ import annotations

import subprocess
import sys

import pytest

from mitsuba_taxel import InputError, Scene
from mitsuba_taxel.backend import registry

PLATE = {"type": "wall", "scattering": "isotropic"}


def test_known_before_and_after_changing_the_variant(llvm_mono):
    mi = llvm_mono
    for variant in ("llvm_ad_mono", "llvm_ad_rgb", "llvm_ad_mono"):
        mi.set_variant(variant)
        assert mi.load_dict(PLATE).scattering == "isotropic"
        assert mi.load_string('<bsdf version="3.9.0" type="wall"/>').scattering == "lambertian"


@pytest.mark.parametrize(
    "order",
    [
        "mi.set_variant('llvm_ad_rgb'); import mitsuba_taxel",
        "import mitsuba_taxel; mi.set_variant('llvm_ad_rgb')",
    ],
)
def test_any_order_of_import_and_variant(order):
    # drjit's LLVM must be chosen before mitsuba is imported, so the backend goes first here.
    code = f"""
from mitsuba_taxel.backend.llvm import choose_llvm
import mitsuba as mi
{order}
print(mi.load_dict({PLATE!r}).scattering)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "isotropic", done.stderr


@pytest.mark.parametrize("variant", ["scalar_rgb", "scalar_spectral", "llvm_ad_spectral", "llvm_ad_mono_polarized"])
def test_other_variants_are_refused_with_a_clear_error(llvm_mono, variant):
    """All plugins under one change of the variant, which takes half a second."""
    mi = llvm_mono
    mi.set_variant(variant)
    try:
        for plugin in ("wall", "annular_led", "deformable_pad", "owen_sobol", "taxel_tracer"):
            refused = f"{plugin} does not work in the variant {variant}: allowed are llvm_ad_mono"
            with pytest.raises(RuntimeError, match=refused):
                mi.load_dict({"type": plugin})
    finally:
        mi.set_variant("llvm_ad_mono")


def test_the_environment_names_the_default(monkeypatch):
    from mitsuba_taxel.backend import default_variant

    monkeypatch.setenv("MITSUBA_TAXEL_VARIANT", "cuda_ad_rgb")
    assert default_variant() == "cuda_ad_rgb"
    monkeypatch.setenv("MITSUBA_TAXEL_VARIANT", "scalar_rgb")
    with pytest.raises(InputError, match="MITSUBA_TAXEL_VARIANT = 'scalar_rgb' is not allowed: one of llvm_ad_mono"):
        default_variant()
    monkeypatch.delenv("MITSUBA_TAXEL_VARIANT")
    assert default_variant() == "llvm_ad_mono"


def test_every_plugin_file_registers_its_name(llvm_mono):
    from mitsuba_taxel.backend import plugin_files

    assert set(plugin_files()) == {
        "annular_led",
        "deformable_pad",
        "owen_sobol",
        "phototransistor",
        "photo_reflector",
        "region",
        "analog_tracer",
        "taxel_path",
        "taxel_tracer",
        "wall",
    }


BOTH = '<emitter type="annular_led"/> <sensor type="phototransistor"/>'


def test_plugins_leave_the_file_resolver_alone(llvm_mono, monkeypatch):
    """`mi.load_dict` exchanges it, and another thread that makes a `ply` of the same scene then reads freed memory."""

    def refuse(*_, **__):
        raise AssertionError("a plugin called mi.load_dict")

    monkeypatch.setattr(llvm_mono, "load_dict", refuse)
    shapes = f'<shape type="photo_reflector">{BOTH}</shape> <shape type="deformable_pad"/>'
    scene = llvm_mono.load_string(f'<scene version="3.9.0">{shapes}</scene>')
    assert len(scene.shapes()) == 2


def test_interrupting_a_plugin_interrupts_the_load(llvm_mono):
    """Mitsuba turns an interrupt in a plugin's constructor into an error; it must not be taken for bad input."""

    def interrupted(props):
        raise KeyboardInterrupt

    llvm_mono.register_bsdf("interrupted", interrupted)
    with pytest.raises(KeyboardInterrupt):
        Scene({"type": "scene", "plate": {"type": "rectangle", "bsdf": {"type": "interrupted"}}}).load()


@pytest.mark.parametrize(
    "variant, message",
    [("cuda_ad_mono", "needs an NVIDIA card and its driver"), ("llvm_ad_rgb", "needs LLVM, .*install LLVM 19")],
)
def test_a_variant_that_this_machine_lacks_is_refused_in_one_line(monkeypatch, variant, message):
    import drjit as dr

    monkeypatch.setattr(dr, "has_backend", lambda backend: False)
    with pytest.raises(ImportError, match=f"^the variant {variant} {message}") as refused:
        registry.check_backend(variant)
    assert "\n" not in str(refused.value)
    monkeypatch.setattr(dr, "has_backend", lambda backend: True)
    registry.check_backend(variant)


def test_the_command_line_allows_the_variants_that_are_supported():
    from taxel_cli import VARIANTS

    assert VARIANTS == registry.SUPPORTED_VARIANTS and VARIANTS[0] == registry.DEFAULT_VARIANT


def test_what_the_processor_does_is_said_for_graphics_cards_only():
    words = [registry.work_of_processor(variant) for variant in registry.SUPPORTED_VARIANTS]
    assert words[:2] == [None, None] and all("on the processor" in str(sentence) for sentence in words[2:])
