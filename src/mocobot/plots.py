"""Draw pictures of campaigns and comparisons."""

from collections.abc import Callable, Mapping
from pathlib import Path
from textwrap import shorten
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimator.files import whole_file
from mocobot_report.campaign import background_words
from mocobot_report.palette import LIGHT
from mocobot_sim.plots_plain import plain_numbers, plain_words

Json = Mapping[str, Any]
COLOURS = {"calibrated": LIGHT["after"], "uncalibrated": LIGHT["before"], "units": LIGHT["after"]}
APART = 1.03
"""Factor by which the points of each further background are shifted to the right, so that bars do not overlap."""
MARKERS = {"calibrated": "o", "uncalibrated": "s", "units": "o"}


@plain_words()
def save_campaign(summary: Json, folder: Path) -> list[Path]:
    """Draw the pictures for which the summary has data, and return their paths.

    Args:
        summary: summary of a campaign (``mocobot.campaign.summary``).
        folder: existing folder for ``limits.png``, ``found.png``, ``confusion.png`` and ``reliability.png``.
    """
    out = []
    if rows := _limit_rows(summary):
        out.append(
            _picture(folder / "limits.png", (9.0, 1.4 + 0.2 * len(rows)), lambda a: _limits(a, summary))
        )
    if summary["found"]:
        out.append(_picture(folder / "found.png", (6.5, 4.2), lambda a: _found(a, summary)))
    if hidden := summary["confusion"]["hidden"]:
        size = (3.0 + 0.35 * len(summary["confusion"]["named"]), 2.6 + 0.3 * len(hidden))
        out.append(_picture(folder / "confusion.png", size, lambda a: _confusion(a, summary["confusion"])))
    if summary["reliability"]["bins"]:
        out.append(_picture(folder / "reliability.png", (5.2, 4.8), lambda a: _reliable(a, summary)))
    return out


def _picture(path: Path, size: tuple[float, float], draw: Callable[[Axes], None]) -> Path:
    figure = Figure(figsize=size, layout="constrained")
    axis = figure.subplots()
    draw(axis)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=110, format="png")
    return path


def _limit_rows(summary: Json) -> list[tuple[str, str]]:
    """List every pair of cause and parameter once."""
    pairs = ((entry["cause"], name) for entry in summary["limits"] for name in entry["parameters"])
    return list(dict.fromkeys(pairs))


def _limits(axis: Axes, summary: Json) -> None:
    rows = _limit_rows(summary)
    backgrounds = list(dict.fromkeys(entry["background"] for entry in summary["limits"]))
    for entry in summary["limits"]:
        shift = 0.24 * (backgrounds.index(entry["background"]) - 0.5 * (len(backgrounds) - 1))
        colour, marker = COLOURS[entry["background"]], MARKERS[entry["background"]]
        for name, sizes in entry["parameters"].items():
            y = rows.index((entry["cause"], name)) + shift
            axis.plot([sizes["low"], sizes["high"]], [y, y], color=colour, lw=1.2)
            axis.plot([sizes["median"]], [y], marker, color=colour, ms=4)
    for background in backgrounds:
        axis.plot([], [], MARKERS[background], color=COLOURS[background], label=background_words(background))
    axis.set_xscale("log")
    plain_numbers(axis.xaxis)
    axis.set_yticks(range(len(rows)), [f"{cause} {name}" for cause, name in rows], fontsize=8)
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.set_xlabel("detection limit, in the parameter's unit: median and range over teams and places")
    axis.grid(axis="x", color=LIGHT["band"])
    axis.legend(frameon=False, fontsize=8)


def _found(axis: Axes, summary: Json) -> None:
    for k, background in enumerate(dict.fromkeys(entry["background"] for entry in summary["found"])):
        own = [entry for entry in summary["found"] if entry["background"] == background]
        at = np.array([entry["factor"] * APART**k for entry in own])
        share = np.array([entry["right"]["hits"] / entry["right"]["of"] for entry in own])
        bounds = np.array([entry["right"]["interval"] for entry in own])
        axis.errorbar(
            at, 100 * share, 100 * np.abs(bounds.T - share), color=COLOURS[background], lw=1.2, capsize=3,
            marker=MARKERS[background], ms=5, label=background_words(background),
        )  # fmt: skip
    sizes = sorted({entry["factor"] for entry in summary["found"]})
    axis.set_xscale("log")
    plain_numbers(axis.xaxis)
    axis.set_xticks(sizes, [f"{size:g}" for size in sizes])
    axis.minorticks_off()
    axis.set_ylim(-3.0, 103.0)
    axis.set_xlabel("size over the detection limit")
    axis.set_ylabel("cause and place right [%], 95 % interval")
    axis.grid(axis="y", color=LIGHT["band"])
    axis.legend(frameon=False, fontsize=8, loc="lower right")


def _confusion(axis: Axes, confusion: Json) -> None:
    counts = np.array(confusion["counts"])
    axis.imshow(counts, cmap="Blues", vmin=0, vmax=max(counts.max(), 1), aspect="auto")
    for row, column in np.argwhere(counts > 0):
        number = counts[row, column]
        dark = number > 0.6 * counts.max()
        axis.text(
            column, row, str(number), ha="center", va="center", fontsize=8, color="white" if dark else "black"
        )
    axis.set_xticks(range(len(confusion["named"])), confusion["named"], rotation=60, ha="right", fontsize=8)
    axis.set_yticks(range(len(confusion["hidden"])), confusion["hidden"], fontsize=8)
    axis.set_xlabel("named for it")
    axis.set_ylabel("hidden")


def _reliable(axis: Axes, summary: Json) -> None:
    found = summary["reliability"]
    axis.plot([0, 100], [0, 100], color=LIGHT["line"], lw=1.0)
    for entry in found["bins"]:
        right = entry["right"]
        share, (low, high) = right["hits"] / right["of"], right["interval"]
        axis.errorbar(
            [100 * entry["mean"]], [100 * share], [[100 * (share - low)], [100 * (high - share)]],
            color=LIGHT["after"], marker="o", ms=5, capsize=3,
        )  # fmt: skip
        axis.annotate(
            f"{right['of']}", (100 * entry["mean"], 100 * share), textcoords="offset points", xytext=(-7, 5),
            ha="right", fontsize=8,
        )  # fmt: skip
    axis.set_xlim(-3.0, 103.0)
    axis.set_ylim(-3.0, 103.0)
    axis.set_xlabel("probability stated [%]; numbers: causes named")
    axis.set_ylabel("right [%], 95 % interval")
    axis.set_title(
        f"Brier score {found['brier']:.3f} of {found['number']} causes named", loc="left", fontsize=9
    )


FARTHEST = 30.0
"""Largest difference in the picture [standard errors]; arrows mark larger ones. Chosen."""


@plain_words()
def save_comparison(found: Any, path: Path) -> None:
    """Draw one row per number, with a band of two standard errors; changed groups have another colour."""
    rows = [(group, k) for group in found.groups for k in range(len(group.entries))]
    _picture(path, (9.0, 1.4 + 0.22 * len(rows)), lambda axis: _compared(axis, found, rows))


def _compared(axis: Axes, found: Any, rows: list[tuple[Any, int]]) -> None:
    axis.axvspan(-2.0, 2.0, color=LIGHT["band"], lw=0)
    axis.axvline(0.0, color=LIGHT["line"], lw=1.0)
    changed, reach = found.changed_groups, 4.0
    for y, (group, k) in enumerate(rows):
        ratio = float(group.ratio[k])
        at = float(np.clip(ratio, -FARTHEST, FARTHEST))
        marker = "o" if at == ratio else ">" if ratio > 0 else "<"
        axis.plot([at], [y], marker, ms=5, color=LIGHT["before" if group in changed else "after"])
        reach = max(reach, abs(at))
    labels = [shorten(f"{group.name} {group.entries[k]}", 50, placeholder=" ...") for group, k in rows]
    axis.set_yticks(range(len(rows)), labels, fontsize=8)
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.set_xlim(-1.08 * reach, 1.08 * reach)
    note = "band: two standard errors; orange: changed; arrow: farther off"
    axis.set_xlabel(f"(B - A) over its standard error; {note}", fontsize=9)
    axis.set_title(f"A: {found.a}\nB: {found.b}", loc="left", fontsize=9)
