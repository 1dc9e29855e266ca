"""Words of studies that ask for first contacts."""

from __future__ import annotations

import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.studies.plan.to_contact import path_to_contact


def test_ways_to_contacts():
    assert path_to_contact("fz=-40") == ("fz", -40.0) and path_to_contact("none") is None


@pytest.mark.parametrize("word", ["fz", "fz=far", "fz=nan", "fz=-inf"])
def test_ways_that_lead_nowhere_are_refused(word):
    with pytest.raises(InputError, match=f"to_contact = '{word}' is not allowed: .*'fz=-40', or none is needed"):
        path_to_contact(word)
