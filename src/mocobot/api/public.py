"""Results of the layers below as what a Python user gets: the same data, with presentation."""

from dataclasses import fields
from typing import Any, TypeVar

Kind = TypeVar("Kind")


def public(kind: type[Kind], below: Any, **more: Any) -> Kind:
    """A result as a subclass of its dataclass.

    Args:
        kind: the subclass.
        below: the result.
        more: fields that the subclass has besides, or has otherwise.
    """
    return kind(**{field.name: getattr(below, field.name) for field in fields(below)} | more)
