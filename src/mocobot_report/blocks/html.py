"""HTML as a tree of nodes: the serialiser escapes every text and attribute, so nothing in a file becomes markup."""

import json
import re
from collections.abc import Iterable, Mapping
from typing import Any
from xml.etree import ElementTree

from estimator.inputs import printable

Node = ElementTree.Element
Child = Node | str | None | Iterable["Child"]

NOT_HTML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufdd0-\ufdef\ufffe\uffff]")
"""Characters that a page may not hold."""


def el(tag: str, /, *children: Child, **attributes: str | int | float | bool | None) -> Node:
    """An element.

    Args:
        tag: its name.
        children: nodes, texts, or lists of them; None is skipped.
        attributes: ``class_`` is ``class``, ``data_x`` is ``data-x``; None and False are left out, True has no value.
    """
    node = ElementTree.Element(tag)
    for key, value in attributes.items():
        if value is not None and value is not False:
            node.set(key.rstrip("_").replace("_", "-"), "" if value is True else _clean(str(value)))
    add(node, *children)
    return node


def add(node: Node, *children: Child) -> Node:
    """Append to an element, and return it."""
    for child in children:
        if child is None:
            continue
        if isinstance(child, str):
            _text(node, _clean(child))
        elif isinstance(child, ElementTree.Element):
            node.append(child)
        else:
            add(node, *child)
    return node


def words(node: Node) -> str:
    """All text of an element."""
    return "".join(node.itertext())


def data_block(identity: str, values: Any) -> Node:
    """A script element that holds JSON; no string in it can end the element or start a comment.

    Args:
        identity: its id.
        values: strict JSON values.
    """
    text = json.dumps(values, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return raw("script", text, type="application/json", id=identity)


def raw(tag: str, text: str, /, **attributes: str) -> Node:
    """A script or style element, whose text is written as it is.

    Raises:
        ValueError: the text would end the element.
    """
    if re.search(f"</{tag}|<!--", text, re.IGNORECASE):
        raise ValueError(f"text of a {tag} element must not hold </{tag} or <!--")
    node = ElementTree.Element(tag, attrib=dict(attributes))
    node.text = text
    return node


def to_bytes(root: Node) -> bytes:
    """The document, UTF-8."""
    return b"<!doctype html>\n" + ElementTree.tostring(root, encoding="utf-8", method="html") + b"\n"


def variables(values: Mapping[str, str]) -> str:
    """CSS custom properties."""
    return "".join(f"--{name}:{value};" for name, value in values.items())


def _clean(text: str) -> str:
    return NOT_HTML.sub(lambda found: printable(found[0]), text)


def _text(node: Node, text: str) -> None:
    if len(node):
        node[-1].tail = (node[-1].tail or "") + text
    else:
        node.text = (node.text or "") + text
