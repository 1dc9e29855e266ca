"""Mitsuba's chi-square test of samples against a density."""

from __future__ import annotations

SIGNIFICANCE = 1e-4
"""Chance that one test fails although all is well."""


def chi2(domain, sample, density, dimensions=2, samples=400_000, resolution=61, inner=16):
    """Assert that samples follow a density over a domain."""
    from mitsuba.chi2 import ChiSquareTest

    test = ChiSquareTest(
        domain=domain,
        sample_func=sample,
        pdf_func=density,
        sample_dim=dimensions,
        sample_count=samples,
        res=resolution,
        ires=inner,
    )
    assert test.run(SIGNIFICANCE, quiet=True), test.messages
