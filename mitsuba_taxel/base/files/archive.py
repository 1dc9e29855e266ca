"""Arrays as checksummed bytes, without pickle.

The SHA-256 of the content comes first, then an npz archive.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Mapping

import numpy as np

_DIGEST = hashlib.sha256().digest_size


def pack(arrays: Mapping[str, np.ndarray]) -> bytes:
    """Serialise arrays with their names as bytes: a SHA-256 digest and an npz archive."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    archive = buffer.getvalue()
    return hashlib.sha256(archive).digest() + archive


def unpack(content: bytes) -> dict[str, np.ndarray] | None:
    """The named arrays that :func:`pack` has serialised; None if the bytes are damaged or of another kind."""
    digest, archive = content[:_DIGEST], content[_DIGEST:]
    if hashlib.sha256(archive).digest() != digest:
        return None
    try:
        with np.load(io.BytesIO(archive), allow_pickle=False) as arrays:
            return dict(arrays)
    except (
        ValueError,
        OSError,
        EOFError,
        zipfile.BadZipFile,
    ):  # the digest is right, but the content is not an archive
        return None
