"""Pictures of teams as data in the page; where nothing can be rendered, the sentence that says why."""

import base64
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_report.blocks.html import Node, add, el
from mocobot_report.blocks.prose import verdict
from mocobot_view.render import Shot, render_shots

WIDTH, HEIGHT, QUALITY = 1120, 700, 84
"""Size of a picture [px] and quality of its JPEG."""
ASPECT = WIDTH / HEIGHT


@dataclass
class Gallery:
    """Pictures that the page wants; all are rendered at once, in one process."""

    asked: list[tuple[Node, Shot, str]] = field(default_factory=list)
    groups: list[Node] = field(default_factory=list)

    def ask(self, wanted: Sequence[tuple[str, Callable[[], Shot]]]) -> Node:
        """A place for pictures.

        Args:
            wanted: caption of each, and what makes its shot; that may raise InputError.
        """
        group = el("div", class_="pair" if len(wanted) > 1 else "single")
        self.groups.append(group)
        for caption, make in wanted:
            try:
                shot = make()
            except InputError as error:
                add(group, verdict("warn", f"No picture: {caption}", str(error)))
                continue
            place = el("figure", class_="picture")
            add(group, place)
            self.asked.append((place, shot, caption))
        return group

    def fill(self) -> None:
        """Render everything; where that cannot be done, one sentence takes the place of each group's pictures."""
        made = render_shots([shot for _, shot, _ in self.asked], WIDTH, HEIGHT)
        if isinstance(made, str):
            places = [place for place, _, _ in self.asked]
            for group in self.groups:
                if mine := [child for child in group if child in places]:
                    for child in mine:
                        group.remove(child)
                    group.set("class", "single")
                    add(group, verdict("warn", "No pictures", made))
            return
        for (place, shot, caption), pixels in zip(self.asked, made, strict=True):
            image = el(
                "img", src=data_uri(pixels), alt=f"{caption}. {shot.says}", width=WIDTH, height=HEIGHT, loading="lazy",
                decoding="async",
            )  # fmt: skip
            add(place, el("figcaption", el("b", caption), shot.says), image)


def data_uri(pixels: NDArray[np.uint8]) -> str:
    """An image as a data URI, JPEG."""
    from PIL import Image  # an extra: without it nothing is rendered

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "JPEG", quality=QUALITY, optimize=True, subsampling=0)
    return "data:image/jpeg;base64," + base64.b64encode(file.getvalue()).decode("ascii")
