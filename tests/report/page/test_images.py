"""The page of a study of images holds all of it, and needs nothing else."""

from __future__ import annotations

import base64
import re

import pandas
import pytest

from mitsuba_taxel import InputError, sweep
from mitsuba_taxel.report.page import write_report

SMALL = {"width": "16", "height": "12", "uz": "-0.4"}
SIZE = 2.0
"""Size in mm of the finite elements."""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies") / "gel"
    sweep("gel.xml", {"x": "-2,40"}, SMALL, points=1, mesh_size=SIZE, output=folder)
    return folder


def cells(page, caption):
    """Rows of the table whose caption begins with some words."""
    table = re.search(rf"<caption>{caption}.*?</table>", page, re.DOTALL)[0]
    rows = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", table)]
    return [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]


def test_the_page_has_pictures_and_numbers_of_all_images(study, tmp_path):
    file = tmp_path / "report.html"
    assert write_report(study, file) == []
    page, listed = file.read_text(encoding="utf-8"), pandas.read_csv(study / "images.csv", comment="#")
    pictures = [base64.b64decode(code) for code in re.findall(r'src="data:image/png;base64,([^"]+)"', page)]
    assert pictures == [(study / name).read_bytes() for name in ("contact_sheet.png", "film.png")]
    assert not re.search(r'(src|href)="(?!data:|#)', page)

    rows = cells(page, "Images")
    assert [row["file"] for row in rows] == listed.image.tolist() and [row["x [mm]"] for row in rows] == ["-2", "40"]
    for row, (_, numbers) in zip(rows, listed.iterrows(), strict=True):
        assert float(row["light [%]"]) == pytest.approx(100 * numbers.relative_error, rel=0.06)
        force = float(re.match(r"[-\d.]+", row["reaction fz [N]"])[0])
        assert force == pytest.approx(numbers.reaction_fz_N, abs=max(numbers.reaction_fz_error_N, 1e-6))
    worst = {row["source"]: row["error [%]"] for row in cells(page, "Largest error")}
    assert float(worst["total"]) == pytest.approx(100 * listed.relative_total_error.max(), rel=0.06)
    assert "in 1 of 2 images, the indenter does not touch the pad" in page
    assert "Scene gel.xml; 2 images; seed 0." in page


def test_a_study_of_images_without_an_image_is_refused(study, tmp_path):
    for image in (study / "images").glob("*.exr"):
        image.unlink()
    with pytest.raises(InputError, match="holds no image yet: run it first"):
        write_report(study, tmp_path / "report.html")
    assert not (tmp_path / "report.html").exists()
