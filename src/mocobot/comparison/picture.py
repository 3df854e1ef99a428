"""A picture of a comparison: every difference over its standard error."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mocobot.comparison.comparison import Comparison
from mocobot_report.palette import LIGHT
from mocobot_sim.plots_plain import plain_words

FARTHEST = 30.0
"""Standard errors at which the picture ends; what is farther off is drawn there as an arrow. Chosen."""


@plain_words()
def save_picture(found: Comparison, path: Path) -> None:
    """Draw a row for each number, with a band of two standard errors; changed groups are in another colour."""
    rows = [(group, k) for group in found.groups for k in range(len(group.entries))]
    figure = Figure(figsize=(9.0, 1.4 + 0.22 * len(rows)), layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    axis.axvspan(-2.0, 2.0, color=LIGHT["band"], lw=0)
    axis.axvline(0.0, color=LIGHT["line"], lw=1.0)
    changed, reach = found.changed_groups, 4.0
    for y, (group, k) in enumerate(rows):
        ratio = float(group.ratio[k])
        at = float(np.clip(ratio, -FARTHEST, FARTHEST))
        marker = "o" if at == ratio else ">" if ratio > 0 else "<"
        axis.plot([at], [y], marker, ms=5, color=LIGHT["before" if group in changed else "after"])
        reach = max(reach, abs(at))
    labels = [f"{group.name} {group.entries[k]}".rstrip() for group, k in rows]
    axis.set_yticks(range(len(rows)), labels, fontsize=8)
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.set_xlim(-1.08 * reach, 1.08 * reach)
    axis.set_xlabel(
        "(B - A) over its standard error; band: two standard errors; orange: changed; arrow: farther off"
    )
    axis.set_title(f"A: {found.a}\nB: {found.b}", loc="left", fontsize=9)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
    figure.savefig(path, dpi=110)
