"""Which causes the rows speak for, and how well the response to the commands is met without and with them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from discrepancy.result.lines import drawn, label, relation
from discrepancy.result.pictures.plots_against import AFTER, BEFORE, log_scale, titled
from discrepancy.result.text_gain import floor_words, foretold_torques, response_units
from mocobot_sim.plots_plain import plain_numbers

RELATIONS = {
    "named": ("named", "#2f6fd0", "s"),
    "family": ("same family", "#3f8f6b", "o"),
    "other": ("other", "#6b7280", "D"),
}


def evidence_figure(values: Mapping[str, Any]) -> Figure:
    """Evidence of the strongest candidates: nothing named yet, and with what is named in the model; on one scale."""
    evidence = values["evidence"]
    panels = [("nothing is named yet", drawn(evidence["before"]))]
    if evidence["after"] is not None:
        panels.append(("the named causes are in the model", drawn(evidence["after"])))
    figure = Figure(figsize=(7.5 * len(panels), 5.2), layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False, sharex=True)[0]
    for axis, (title, strongest) in zip(axes, panels, strict=True):
        _dots(axis, strongest, values["causes"])
        axis.set_title(f"when {title}", loc="left", fontsize=10)
    seen = [entry[key] for _, strongest in panels for entry in strongest for key in ("nats", "needed")]
    # Dots: bars would need a zero, which a log axis has not.
    axes[0].set_xlim(0.6, 3.0 * max(seen, default=10.0))
    shown = RELATIONS if values["causes"] else {"other": ("candidate", *RELATIONS["other"][1:])}
    handles = [axes[0].plot([], [], mark, color=colour)[0] for _, colour, mark in shown.values()]
    handles += axes[0].plot([], [], "|", color="black", markersize=12)
    words = [*(word for word, _, _ in shown.values()), "needed to be named"]
    title = "Evidence that a cause is there"
    return titled(figure, title, handles, words, len(words))


def _dots(axis: Axes, strongest: Sequence[Mapping[str, Any]], causes: Sequence[Mapping[str, Any]]) -> None:
    at = list(range(len(strongest)))[::-1]
    axis.set_xscale("log")
    for y, entry in zip(at, strongest, strict=True):
        _, colour, mark = RELATIONS[relation(entry, causes)]
        axis.plot(entry["needed"], y, "|", color="black", markersize=12)
        axis.plot(entry["nats"], y, mark, color=colour, markersize=7)
        nats = f"{entry['nats']:.0f}" if entry["nats"] >= 100 else f"{entry['nats']:.3g}"
        right = entry["nats"] > entry["needed"]  # not where the mark of what is needed is
        axis.annotate(nats, (entry["nats"], y), (8 if right else -8, 0), textcoords="offset points", va="center",
                      ha="left" if right else "right", fontsize=8)  # fmt: skip
    axis.set_yticks(at, [label(entry) for entry in strongest], fontsize=9)
    axis.set_ylim(-0.7, max(len(strongest), 1) - 0.3)
    plain_numbers(axis.xaxis)
    axis.set_xlabel("log Bayes factor [nats]")
    axis.grid(alpha=0.25)
    if not strongest:
        axis.text(0.5, 0.5, "nothing speaks for any cause", transform=axis.transAxes, ha="center", fontsize=9)


def closed_loop_figure(values: Mapping[str, Any]) -> Figure | None:
    """Error of every channel and chi-square per trial, without and with the causes; None where not simulated."""
    gain = values["gain"]
    trials = [t for t in (gain or {}).get("trials", ()) if t["before"] is not None]
    if not trials:
        return None
    named = bool(values["causes"])
    panels = [(f"{name}_rms", f"{name} rms", *shown) for name, shown in response_units(gain).items()]
    panels.append(("chi2_per_n", "chi2/n", "", 1.0))
    figure = Figure(figsize=(3.6 * len(panels), 4.0), layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    at = np.arange(len(trials))
    for axis, (key, title, unit, scale) in zip(axes, panels, strict=True):
        series = (
            [("before", -0.1, BEFORE, "s"), ("after", 0.1, AFTER, "o")]
            if named
            else [("before", 0.0, BEFORE, "s")]
        )
        low, high = np.inf, 0.0
        for which, shift, colour, mark in series:
            heights = np.array([np.nan if t[which] is None else scale * t[which][key] for t in trials])
            axis.plot(
                at + shift, heights, mark, color=colour, markersize=8, label=which if named else "error"
            )
            low, high = min(low, float(np.nanmin(heights))), max(high, float(np.nanmax(heights)))
        floor = scale * gain["noise"][key] if key in gain["noise"] else 1.0
        axis.axhline(floor, color="black", linewidth=0.8, linestyle="--", label=floor_words(gain))
        low, high = min(low, floor), max(high, floor)
        if high > 12.0 * low:
            log_scale(axis, 10 ** np.floor(np.log10(0.9 * low)), 10 ** np.ceil(np.log10(1.1 * high)))
        else:
            axis.set_ylim(0.0, 1.15 * high)
        axis.set_xlim(-0.6, len(trials) - 0.4)
        axis.set_xticks(at, [f"{k + 1}" for k in at])
        axis.set_xlabel("trial")
        axis.set_title(
            f"{title} [{unit}]" if unit else f"{title} ({floor_words(gain).removesuffix(' error')} = 1)",
            loc="left",
            fontsize=10,
        )
        axis.grid(axis="y", alpha=0.25)
    handles, labels = axes[0].get_legend_handles_labels()
    if foretold_torques(gain):
        title = "Torques, foretold from the recorded motion: error"
    else:
        title = "Recorded commands, simulated again: error of the response"
    return titled(figure, title, handles, labels)
