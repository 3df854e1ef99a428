"""What the parts of a page share: running ids, the pictures they want, how far the work is; sections and panels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from mocobot_report.blocks.html import Child, Node, el
from mocobot_report.blocks.pictures import Gallery


@dataclass
class Book:
    """One page in the making.

    Attributes:
        say: takes the name of what is being made.
        counts: how many ids of each kind are given out.
        gallery: pictures to be rendered.
    """

    say: Callable[[str], object] = lambda _: None
    counts: dict[str, int] = field(default_factory=dict)
    gallery: Gallery = field(default_factory=Gallery)

    def identity(self, kind: str) -> str:
        """An id that the page has once; the same for the same inputs."""
        self.counts[kind] = self.counts.get(kind, 0) + 1
        return f"{kind}-{self.counts[kind]}"


def section(book: Book, title: str, *children: Child, level: int = 3, identity: str | None = None) -> Node:
    """A section with its heading."""
    name = identity or book.identity("part")
    heading = el(f"h{level}", title, id=f"{name}-title")
    return el("section", heading, *children, id=name, aria_labelledby=f"{name}-title")


def tabs(book: Book, name: str, panels: Sequence[tuple[str, Child]]) -> list[Node]:
    """Panels of which one is shown at a time; radio buttons, so arrow keys choose. A single panel needs no choice."""
    group = book.identity("choice")
    shown = [
        el("div", content, id=f"{group}-{k}", data_panel=True, role="group", aria_label=label)
        for k, (label, content) in enumerate(panels)
    ]
    if len(panels) == 1:
        return shown
    inputs = [
        el(
            "label",
            el("input", type="radio", name=group, value=f"{group}-{k}", checked=k == 0, autocomplete="off"),
            label,
        )
        for k, (label, _) in enumerate(panels)
    ]
    return [el("fieldset", el("legend", name), *inputs, class_="tabs"), *shown]
