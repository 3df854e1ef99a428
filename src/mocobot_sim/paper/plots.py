"""Plots of Tables II-V: our errors and the published ones on logarithmic axes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from estimator.files import whole_file
from mocobot_sim.paper.experiment import ONE_FIT, SCATTERED, SELF_CALIBRATED, TRANSFER
from mocobot_sim.paper.tables import BY_ENCODERS, MOMENTS, AllScores, Row, paper_tables, spring_share
from mocobot_sim.plots_plain import plain_numbers, plain_words

COLOURS = {
    "paper": "#6b7280", "ideal": "#2a9d8f", "nominal": "#2f6fd0", ONE_FIT: "#2f6fd0", "uncalibrated": "#e07b39",
    SCATTERED: "#8a5a2b",
    SELF_CALIBRATED: "#a6407d", TRANSFER: "#a6407d",
}  # fmt: skip
MARKERS = {
    "paper": "D", "ideal": "v", "nominal": "o", ONE_FIT: "o", "uncalibrated": "s", SCATTERED: "P",
    SELF_CALIBRATED: "^", TRANSFER: "^",
}  # fmt: skip
HOLLOW = (ONE_FIT, TRANSFER)
DPI = 130
SHARE = "springs' common scale"
"""Label of the line in the plots of mass and inertia for the common stiffness scale (see ``spring_share``)."""


@plain_words()
def save_plots(scores: AllScores, folder: Path) -> list[Path]:
    """Draw one plot per group of tables and return the paths.

    Args:
        scores: scores by preset or column of fits, then payload, as in ``paper.json``.
        folder: existing folder for ``grasps.png``, ``mass_com.png`` and ``inertia.png``.
    """
    tables = {table.number: table for table in paper_tables(scores)}
    columns, share = tables["II"].columns, spring_share(scores)

    def panel(
        number: str, unit: str, title: str, quantity: str | None = None, frames: str = ""
    ) -> tuple[Sequence[Row], str]:
        return tables[number].part(unit, quantity, frames).rows, f"Table {number}: {title}"

    def picture(
        name: str, size: tuple[float, float], across: int, *panels: tuple[Sequence[Row], str]
    ) -> Path:
        # Avoid pyplot, which needs a display and has global state.
        shown = [one for one in panels if one[0]]
        across = min(across, len(shown))
        down = -(-len(shown) // across)
        figure = Figure(figsize=(size[0], size[1] * down), layout="constrained")
        axes = np.ravel(np.asarray(figure.subplots(down, across)))
        for axis, (rows, title) in zip(axes, shown, strict=True):
            _dots(axis, columns, rows, title)
            if share and rows[0].unit == "%" and rows[0].quantity in ("m", *MOMENTS):
                axis.axhline(share, color=COLOURS[SELF_CALIBRATED], linewidth=0.9, linestyle=":", label=SHARE)
        return _save(figure, axes[0], folder / name)

    return [
        picture(
            "grasps.png", (11, 2.9), 1,
            panel("II", "deg", "rotation error [deg]"),
            panel("II", "deg", "rotation error in the frames that the encoders define [deg]", frames=BY_ENCODERS),
            panel("III", "%", "position error [% of |p|]"),
            panel("III", "%", "position error in the frames that the encoders define [% of |p|]", frames=BY_ENCODERS),
        ),
        picture(
            "mass_com.png", (11, 4.2), 3,
            panel("IV", "%", "mass error [%]", "m"),
            panel("IV", "%", "centre-of-mass error [% of |p1c|]", "p1c"),
            panel("IV", "%", "the same, encoder frames", "p1c", BY_ENCODERS),
        ),
        picture(
            "inertia.png", (11, 4.4), 1,
            panel(
                "V", "%",
                "|mean error| of the principal moments [%] (whisker: mean + standard deviation of the estimates)",
            ),
        ),
    ]  # fmt: skip


def _label(row: Row) -> str:
    """Label of a row: payload, and pair or moment where there are several."""
    part = "" if row.quantity in ("m", "p1c") else row.quantity.lstrip("Rp")
    return f"({row.payload}) {part}".rstrip()


def _dots(axis: Axes, columns: Sequence[str], rows: Sequence[Row], title: str) -> None:
    """Draw one dot per column and row, with an upward whisker of one standard deviation.

    There is no downward whisker, because the axis is logarithmic.
    """
    labels = [_label(row) for row in rows]
    for k, name in enumerate(columns):
        x = [i + min(0.13, 0.8 / len(columns)) * (k - (len(columns) - 1) / 2) for i in range(len(rows))]
        cells = [row.cells[k] for row in rows]
        shown = [float("nan") if cell.value is None else cell.value for cell in cells]
        up = [cell.spread or 0.0 for cell in cells]
        axis.errorbar(
            x, shown, yerr=[[0.0] * len(up), up], label=name, color=COLOURS.get(name),
            fmt=MARKERS.get(name, "o"), markersize=6, elinewidth=1.2, capsize=2,
            markerfacecolor="white" if name in HOLLOW else COLOURS.get(name),
        )  # fmt: skip
    axis.set_yscale("log")
    plain_numbers(axis.yaxis)
    axis.set_xlim(-0.5, len(labels) - 0.5)
    axis.set_xticks(range(len(labels)), labels)
    axis.set_xticks([i + 0.5 for i in range(len(labels) - 1)], minor=True)
    axis.tick_params(axis="x", which="both", length=0)
    axis.grid(axis="y", alpha=0.3)
    axis.grid(axis="x", which="minor", alpha=0.3)
    axis.set_title(title, loc="left", fontsize=10)


def _save(figure: Figure, legend_of: Axes, path: Path) -> Path:
    named = dict(zip(*reversed(legend_of.get_legend_handles_labels()), strict=True))
    labels = sorted(named, key=lambda name: name == SHARE)
    figure.legend(
        [named[name] for name in labels], labels, loc="outside upper right",
        ncols=len(labels) if len(labels) <= 6 else -(-len(labels) // 2), frameon=False, fontsize=9,
        columnspacing=1.2, handletextpad=0.2,
    )  # fmt: skip
    # Compute the layout here: savefig would draw the figure an extra time for it.
    figure.set_dpi(DPI)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")
    with whole_file(path) as temporary:
        FigureCanvasAgg(figure).print_png(temporary)
    return path
