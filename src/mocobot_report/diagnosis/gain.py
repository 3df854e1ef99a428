"""What the causes are worth: response to the recorded commands, and estimates of the payload, before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from discrepancy.result.text_gain import ERRORS
from mocobot_report.blocks.blocks import Entry, Num, folded, paragraph, section, table, tidy, value, verdict
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.charts import (
    Json,
    Key,
    axis,
    chart,
    dots,
    layout,
    literal,
    log_axis,
    paint,
    shared_legend,
)
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.numbers import NONE, fitting, percent, plain

Values = Mapping[str, Any]
BEFORE = Key("before", "as simulated", "before", "square")
ERROR = Key("before", "error", "before", "square")
AFTER = Key("after", "with the causes", "after", "circle")
NOISE = Key("", "noise and integration error", "text", "dash")


def gain_section(book: Book, values: Values, names: Sequence[str]) -> Node | None:
    """Closed loop, errors and estimates; None where the JSON has nothing of them."""
    gain = values["gain"]
    if gain is None:
        return None
    named = bool(values["causes"])
    blocks: list[Node] = []
    before, after = gain["held_out"]["before"], gain["held_out"]["after"]
    if before is not None and after is not None:
        blocks += _closed_loop(book, gain, names, named=named)
    elif values["not_simulated"]:
        blocks.append(
            verdict("plain", "The closed loop was not simulated", tidy(f"{values['not_simulated']}."))
        )
    if "errors" in gain:
        rows: list[list[Entry]] = [
            [label.split(" [")[0], label.split("[")[-1].rstrip("]"), *_both(gain["errors"], key, named=named)]
            for key, label in ERRORS.items()
        ]
        head = ["error of", "unit", *(["before", "after"] if named else ["error"])]
        note = "the truth lies beside the recordings; it was opened after the verdict"
        blocks.append(table("Error of the payload's estimate", head, rows, note=note))
    if gain.get("estimates") and named:
        blocks.append(folded("The payload's estimate before and after", _estimates(gain["estimates"])))
    if not blocks:
        return None
    return section(book, "What the causes are worth" if named else "Response to the commands", *blocks)


def _both(values: Values, key: str, *, named: bool) -> list[Entry]:
    return [value(values[which][key], 3) for which in (("before", "after") if named else ("before",))]


def _closed_loop(book: Book, gain: Values, names: Sequence[str], *, named: bool) -> list[Node]:
    before, after = gain["held_out"]["before"], gain["held_out"]["after"]
    where = (
        "on trials left out of the fit"
        if gain["validated"]
        else "on the trial it was fitted to: not validated"
    )
    said = f"The recorded commands are simulated again, {where}."
    if gain["removed"] is not None and named:
        low, high = gain["removed"]["interval"]
        said += f" The causes remove {percent(gain['removed']['share'])} of the error beyond noise"
        count = sum(t["before"] is not None and t["after"] is not None for t in gain["trials"])
        if low is not None and high is not None and count > 1:
            said += f" (95 % interval over {count} trials: {percent(low)} to {percent(high)})"
        said += "."
    head = ["channel", "unit", *(["before", "after"] if named else ["error"]), "noise alone"]
    head += ["before / motion [%]", "after / motion [%]"] if named else ["error / motion [%]"]
    rows: list[list[Entry]] = []
    for channel, unit in gain["units"].items():
        key = f"{channel}_rms"
        shown, scale = fitting(unit, before[key])
        errors = [before[key], after[key]][: 1 + named]
        shares = [w[f"{channel}_nrmse"] for w in (before, after)][: 1 + named]
        rows.append(
            [channel, shown, *(value(scale * e, 3) for e in errors), value(scale * gain["noise"][key], 3),
             *(value(100.0 * s, 2) for s in shares)]
        )  # fmt: skip
    chi2 = [before["chi2_per_n"], after["chi2_per_n"]][: 1 + named]
    rows.append(["chi²/n", "", *(value(c, 3) for c in chi2), Num("1"), *(Num(NONE) for _ in chi2)])
    charts = [_trials_chart(book, gain, key, unit, names, named=named) for key, unit in gain["units"].items()]
    charts.append(_trials_chart(book, gain, None, "", names, named=named))
    return [
        paragraph(said),
        table("Error of the simulated response, rms over the trials", head, rows),
        shared_legend([*([BEFORE, AFTER] if named else [ERROR]), NOISE]),
        el("div", *charts, class_="pair"),
    ]


def _trials_chart(
    book: Book, gain: Values, channel: str | None, unit: str, names: Sequence[str], *, named: bool
) -> Node:
    """One dot per trial, before and after, the noise floor dashed."""
    key = "chi2_per_n" if channel is None else f"{channel}_rms"
    trials = gain["trials"]
    largest = max((t["before"][key] for t in trials if t["before"] is not None), default=1.0)
    shown, scale = ("", 1.0) if channel is None else fitting(unit, largest)
    floor = 1.0 if channel is None else scale * gain["noise"][key]
    keys = [BEFORE, AFTER] if named else [ERROR]
    data, seen = [], [floor]
    for entry, which in zip(keys, ("before", "after"), strict=False):
        values = [None if t[which] is None else scale * t[which][key] for t in trials]
        seen += [v for v in values if v is not None]
        text = [f"{name}, {entry.label}: {plain(v)} {shown}" for name, v in zip(names, values, strict=True)]
        data.append(dots(list(range(len(trials))), values, entry, text=text, size=10))
    positive = [v for v in seen if v > 0]
    title = "chi²/n" if channel is None else f"{channel} rms"
    figure: Json = {
        "data": data,
        "layout": layout(
            xaxis=axis(
                "", tickvals=list(range(len(names))), ticktext=_fitted(names), range=[-0.5, len(names) - 0.5],
                showgrid=False, zeroline=False, fixedrange=True,
            ),
            yaxis=log_axis(f"{title} [{shown}]" if shown else title, min(positive), max(positive)),
            shapes=[
                {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "yref": "y", "y0": floor, "y1": floor,
                 "line": {"color": paint("text"), "width": 1.2, "dash": "dash"}}
            ],
            margin={"l": 60, "r": 12, "t": 8, "b": 26},
        ),
    }  # fmt: skip
    return chart(
        book, f"Response: {title}", figure, height=230,
        label=f"{title} of every trial's simulated response, before and after; the means are in the table.",
    )  # fmt: skip


def _fitted(names: Sequence[str]) -> list[str]:
    """Labels that fit below a narrow plot."""
    if len(names) <= 6 and all(len(name) <= 40 // len(names) for name in names):
        return [literal(name) for name in names]
    return [str(k + 1) for k in range(len(names))]


def _estimates(estimates: Values) -> Node:
    rows: list[list[Entry]] = []

    def row(label: str, unit: str, read: Any, scale: float = 1.0) -> None:
        both = [scale * float(read(estimates[which])) for which in ("before", "after")]
        rows.append([label, unit, *(value(v, 6) for v in both), value(both[1] - both[0], 2)])

    row("mass", "kg", lambda e: e["mass_kg"])
    for k, name in enumerate("xyz"):
        row(f"p_1c {name}", "mm", lambda e, k=k: e["p_1c_m"][k], 1e3)
    for k in range(3):
        row(f"principal moment {k + 1}", "kg m²", lambda e, k=k: e["principal_inertia_kgm2"][k])
    for i in range(1, len(estimates["before"]["grasps"])):
        row(f"|p_1{i + 1}|", "mm", lambda e, i=i: np.linalg.norm(e["grasps"][i]["p_1i_m"]), 1e3)
    return table("Payload's estimate", ["", "unit", "before", "after", "change"], rows)
