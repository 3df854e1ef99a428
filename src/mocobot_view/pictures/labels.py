"""Words written into a picture."""

from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from mocobot_view.pictures.marks import Label

SIZE = 0.028
"""Height of the letters over that of the picture, with at least so many pixels:"""
LEAST_PX = 9.0
HALO, HALO_SHARE = "white", 0.25


def with_labels(
    picture: NDArray[np.uint8], labels: Sequence[Label], at: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """The picture with words in front of everything.

    Args:
        picture: shape (height, width, 3).
        labels: what to write.
        at: columns and rows of their middles, NaN for what is behind the camera; shape (K, 2).
    """
    inside = [
        (label, x, y)
        for label, (x, y) in zip(labels, at, strict=True)
        if 0 <= x < picture.shape[1] and 0 <= y < picture.shape[0]
    ]
    if not inside:
        return picture
    height, width = picture.shape[:2]
    figure = Figure(figsize=(width / 100.0, height / 100.0), dpi=100.0)
    canvas = FigureCanvasAgg(figure)
    figure.figimage(picture)
    points = 0.72 * max(SIZE * height, LEAST_PX)  # of 1/72 inch, 100 pixels an inch
    taken: list[Bbox] = []
    for label, x, y in sorted(inside, key=lambda entry: -entry[2]):
        text = figure.text(
            x / width, 1.0 - y / height, label.text, color=tuple(part / 255.0 for part in label.rgb), fontsize=points,
            fontweight="bold", ha="center", va="center", parse_math=False,
            path_effects=[withStroke(linewidth=HALO_SHARE * points, foreground=HALO)],
        )  # fmt: skip
        _make_room(text, taken, canvas, width, height)
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3])


def _make_room(text: Text, taken: list[Bbox], canvas: FigureCanvasAgg, width: int, height: int) -> None:
    """Move a word into the picture, and up over the words that are there."""
    renderer = canvas.get_renderer()
    rim = 0.5 * HALO_SHARE * float(text.get_fontsize()) * 100.0 / 72.0
    for _ in range(len(taken) + 1):
        box = text.get_window_extent(renderer).padded(rim)
        x, y = text.get_position()
        x += (max(0.0, -box.x0) - max(0.0, box.x1 - width)) / width
        over = [other for other in taken if box.overlaps(other)]
        if over:
            y += (max(other.y1 for other in over) - box.y0 + 1.0) / height
        text.set_position((x, y))
        if not over:
            break
    taken.append(text.get_window_extent(renderer).padded(rim))
