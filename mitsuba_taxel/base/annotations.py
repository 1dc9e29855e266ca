"""Annotations of classes as text, in every version of Python."""

from __future__ import annotations

import inspect
import sys


def annotations_of(class_: type) -> dict[str, str]:
    """Annotations of a class, without those of its bases.

    Python 3.14 evaluates annotations on request, but some annotations contain names that only type checkers import:
    their source is returned.

    Parameters
    ----------
    class_ : type
        Any class.

    Returns
    -------
    dict[str, str]
        The annotations as text, by name.
    """
    if sys.version_info >= (3, 14):
        from annotationlib import Format, get_annotations

        return get_annotations(class_, format=Format.STRING)
    return {name: str(annotation) for name, annotation in inspect.get_annotations(class_).items()}
