"""Archives come back whole, or not at all."""

from __future__ import annotations

import hashlib
import io

import numpy as np
import pytest

from mitsuba_taxel.base.files import archive

pytestmark = pytest.mark.quick


def test_arrays_come_back():
    arrays = {"a": np.arange(6.0).reshape(2, 3), "b": np.array("words")}
    back = archive.unpack(archive.pack(arrays))
    assert back is not None and back.keys() == arrays.keys()
    assert all(np.array_equal(back[name], arrays[name]) for name in arrays)


def sealed(content: bytes) -> bytes:
    return hashlib.sha256(content).digest() + content


PICKLED = np.array([{"a": 1}], dtype=object)


@pytest.mark.parametrize(
    "content",
    [b"", b"short", archive.pack({"a": np.zeros(3)})[:-1], sealed(b""), sealed(b"PK\x03\x04 junk"), sealed(b"no zip")],
    ids=["empty", "short", "cut off", "sealed nothing", "sealed junk", "sealed words"],
)
def test_anything_else_is_none(content):
    assert archive.unpack(content) is None


def test_objects_are_neither_written_nor_read():
    with pytest.raises(ValueError, match="pickle"):
        archive.pack({"a": PICKLED})
    buffer = io.BytesIO()
    np.savez(buffer, a=PICKLED)
    assert archive.unpack(sealed(buffer.getvalue())) is None
