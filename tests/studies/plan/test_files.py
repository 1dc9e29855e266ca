"""Files are whole or not there; folders are checked before anything is computed."""

from __future__ import annotations

import os
from contextlib import contextmanager

import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.studies.plan.files import check_new_file, make_empty_folder, make_folder


def test_file_appears_only_when_it_is_whole(tmp_path):
    file = tmp_path / "table.csv"
    with replacing(file) as temporary:
        temporary.write_text("whole")
        assert not file.exists() and temporary.suffix == ".csv"
    assert file.read_text() == "whole" and os.listdir(tmp_path) == ["table.csv"]


def test_old_file_stays_when_writing_fails(tmp_path):
    file = tmp_path / "table.csv"
    file.write_text("old")
    with pytest.raises(RuntimeError), replacing(file) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert file.read_text() == "old" and os.listdir(tmp_path) == ["table.csv"]


def test_permissions_are_those_of_any_new_file(tmp_path):
    (tmp_path / "plain").touch()
    with replacing(tmp_path / "table.csv"):
        pass
    assert (tmp_path / "table.csv").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_folders(tmp_path):
    make_folder(tmp_path / "a" / "b")
    make_empty_folder(tmp_path / "a" / "b")
    (tmp_path / "a" / "b" / "file").touch()
    make_folder(tmp_path / "a" / "b")
    with pytest.raises(InputError, match="not empty"):
        make_empty_folder(tmp_path / "a" / "b")
    with pytest.raises(InputError, match="is a file: a folder is needed"):
        make_folder(tmp_path / "a" / "b" / "file")
    with pytest.raises(InputError, match="cannot be written"):
        make_folder(tmp_path / "a" / "b" / "file" / "c")


@contextmanager
def nobody():
    """Root may write everywhere: be nobody for a while."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_write_protected(tmp_path):
    tmp_path.chmod(0o500)
    with nobody(), pytest.raises(InputError, match="Permission denied"):
        make_folder(tmp_path)
    with nobody(), pytest.raises(InputError, match="Permission denied"):
        check_new_file(tmp_path / "map.exr", ".exr")
    tmp_path.chmod(0o700)
