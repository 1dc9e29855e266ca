"""Annotations of classes as source text, in the same form in every version of Python."""

from __future__ import annotations

import inspect
import sys


def annotations_of(class_: type) -> dict[str, str]:
    """Source text of the annotations of a class, without those of its base classes.

    Python 3.14 evaluates annotations when they are read, which fails for names that only type checkers import. The
    source text of annotations is therefore returned in every version.

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
