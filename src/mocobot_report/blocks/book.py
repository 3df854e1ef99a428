"""What the parts of a page share: running ids, the pictures they want, and how far the work is."""

from collections.abc import Callable
from dataclasses import dataclass, field

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
