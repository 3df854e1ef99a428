"""Which causes the rows speak for, and how well the response to the commands is met without and with them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from discrepancy.result.evidence_list import label, relation
from discrepancy.result.plots_against import AFTER, BEFORE, log_scale, titled
from discrepancy.result.text_gain import SMALL_UNITS

NAMED, FAMILY, OTHER = "#2f6fd0", "#8fb3e8", "#b9bfc9"


def evidence_figure(values: Mapping[str, Any]) -> Figure:
    """Evidence of the strongest candidates: nothing named yet, and with what is named in the model."""
    evidence = values["evidence"]
    panels = [("nothing is named yet", evidence["before"])]
    if evidence["after"] is not None:
        panels.append(("the named causes are in the model", evidence["after"]))
    figure = Figure(figsize=(7.5 * len(panels), 5.2), layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for axis, (title, strongest) in zip(axes, panels, strict=True):
        _bars(axis, strongest, values["causes"], evidence["by_chance"])
        axis.set_title(f"when {title}", loc="left", fontsize=10)
    handles = [axes[0].barh(np.nan, np.nan, color=c) for c in (NAMED, FAMILY, OTHER)]
    if values["causes"]:
        figure.legend(
            handles, ["named", "same family", "other"], loc="outside upper right", ncols=3, frameon=False,
            fontsize=9,
        )  # fmt: skip
    figure.suptitle("Evidence: how much chi-square falls if the cause leaves its tolerance", x=0.01, ha="left",
                    fontsize=11)  # fmt: skip
    return figure


def _bars(
    axis: Axes, strongest: Sequence[Mapping[str, Any]], causes: Sequence[Mapping[str, Any]], by_chance: float
) -> None:
    gains = [max(entry["gain"], 1.0) for entry in strongest]
    at = list(range(len(gains)))[::-1]
    colours = {"named": NAMED, "family": FAMILY, "other": OTHER}
    axis.barh(at, gains, color=[colours[relation(entry, causes)] for entry in strongest])
    axis.set_yticks(at, [label(entry) for entry in strongest], fontsize=9)
    axis.set_ylim(-0.7, max(len(gains), 1) - 0.3)
    axis.set_xscale("log")
    axis.set_xlim(1.0, 3.0 * max([by_chance, *gains]))
    for y, gain, entry in zip(at, gains, strongest, strict=True):
        axis.text(1.05 * gain, y, f"{entry['gain']:.3g}", va="center", fontsize=8)
    axis.axvline(by_chance, color="black", linewidth=0.8, linestyle="--")
    axis.set_xlabel("gain of chi-square (dashed: what chance can do)")
    axis.grid(axis="x", alpha=0.25)


def closed_loop_figure(values: Mapping[str, Any]) -> Figure | None:
    """Error of every channel and chi-square per trial, without and with the causes; None where not simulated."""
    gain = values["gain"]
    trials = [t for t in (gain or {}).get("trials", ()) if t["before"] is not None]
    if not trials:
        return None
    named = bool(values["causes"])
    panels = [
        (f"{name}_rms", f"{name} rms", *SMALL_UNITS.get(unit, (unit, 1.0)))
        for name, unit in gain["units"].items()
    ]
    panels.append(("chi2_per_n", "chi2/n", "", 1.0))
    figure = Figure(figsize=(3.6 * len(panels), 4.0), layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    at = np.arange(len(trials))
    for axis, (key, title, unit, scale) in zip(axes, panels, strict=True):
        series = [("before", -0.2, BEFORE), ("after", 0.2, AFTER)] if named else [("before", 0.0, BEFORE)]
        low, high = np.inf, 0.0
        for which, shift, colour in series:
            heights = np.array([np.nan if t[which] is None else scale * t[which][key] for t in trials])
            axis.bar(at + shift, heights, 0.38, color=colour, label=which if named else "error")
            low, high = min(low, float(np.nanmin(heights))), max(high, float(np.nanmax(heights)))
        floor = scale * gain["noise"][key] if key in gain["noise"] else 1.0
        axis.axhline(floor, color="black", linewidth=0.8, linestyle="--", label="noise and integration error")
        low, high = min(low, floor), max(high, floor)
        if high > 12.0 * low:
            log_scale(axis, 10 ** np.floor(np.log10(0.9 * low)), 10 ** np.ceil(np.log10(1.1 * high)))
        axis.set_xticks(at, [f"{k + 1}" for k in at])
        axis.set_xlabel("trial")
        axis.set_title(
            f"{title} [{unit}]" if unit else f"{title} (noise and integration = 1)", loc="left", fontsize=10
        )
        axis.grid(axis="y", alpha=0.25)
    handles, labels = axes[0].get_legend_handles_labels()
    return titled(figure, "Recorded commands, simulated again: error of the response", handles, labels)
