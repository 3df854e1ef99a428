"""What the causes are worth: response to the recorded commands, and estimates of the payload, before and after."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from discrepancy.result.remains import all_as_found
from discrepancy.result.tables import ERRORS, floor_words, foretold_torques, response_units, something_is_off
from mocobot_report.blocks.book import Book, section
from mocobot_report.blocks.charts import chart, column_axis, dots, figure, literal, log_axis
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.legend import Key, shared_legend
from mocobot_report.blocks.numbers import NONE, percent, plain, spelled
from mocobot_report.blocks.prose import folded, paragraph, tidy, verdict
from mocobot_report.blocks.tables import Entry, Num, table, value

Values = Mapping[str, Any]
BEFORE, AFTER = (
    Key("before", "as simulated", "before", "square"),
    Key("after", "with the causes", "after", "circle"),
)
ERROR = Key("before", "error", "before", "square")


def gain_section(book: Book, values: Values, names: Sequence[str]) -> Node | None:
    """Closed loop, errors and estimates; None where the JSON has nothing of them."""
    gain, named = values["gain"], bool(values["causes"])
    if gain is None:
        return None
    both, known = {"before": BEFORE, "after": AFTER}, something_is_off(values)
    blocks: list[Node] = []
    if gain["held_out"]["before"] is not None and gain["held_out"]["after"] is not None:
        # Later parts of a long recording are not simulated again.
        short = dict(zip(values["recordings"], names, strict=True))
        trials = [short[trial["name"]] for trial in gain["trials"]]
        blocks += _closed_loop(book, gain, trials, both if named else {"before": ERROR})
    elif values["not_simulated"]:
        blocks.append(
            verdict("plain", "The closed loop was not simulated", tidy(f"{values['not_simulated']}."))
        )
    if "errors" in gain:
        blocks.append(_errors(gain["errors"], both if known else ["before"]))
    if gain.get("estimates") and known:
        blocks.append(folded("The payload's estimate before and after", _estimates(gain["estimates"])))
    if not blocks:
        return None
    title = "What the causes are worth" if named else "Response to the commands"
    return section(book, "What it is worth to know the robots" if known and not named else title, *blocks)


def _heads(shown: Collection[str]) -> list[str]:
    return list(shown) if len(shown) > 1 else ["error"]


def _errors(errors: Values, shown: Collection[str]) -> Node:
    rows: list[list[Entry]] = [
        [
            name.split(" [")[0],
            name.split("[")[-1].rstrip("]"),
            *(value(errors[which][key], 3) for which in shown),
        ]
        for key, name in ERRORS.items()
    ]
    note = "the truth lies beside the recordings; it was opened after the verdict"
    return table("Error of the payload's estimate", ["error of", "unit", *_heads(shown)], rows, note=note)


def _closed_loop(book: Book, gain: Values, names: Sequence[str], shown: Mapping[str, Key]) -> list[Node]:
    where = (
        "on trials left out of the fit" if gain["validated"] else "on trials it was fitted to: not validated"
    )
    of_motion = foretold_torques(gain)
    what = (
        "Torques are foretold from the recorded motion"
        if of_motion
        else "The recorded commands are simulated again"
    )
    said = f"{what}, {where}."
    if gain["removed"] is not None and "after" in shown:
        low, high = gain["removed"]["interval"]
        said += f" The causes remove {percent(gain['removed']['share'])} of the error beyond noise"
        count = sum(t["before"] is not None and t["after"] is not None for t in gain["trials"])
        if low is not None and high is not None and count > 1:
            said += f" (95 % interval over {count} trials: {percent(low)} to {percent(high)})"
        said += "."
    said += "".join(f" Chi²/n is {found}." for found in all_as_found(gain))
    charts = [_trials_chart(book, gain, f"{channel}_rms", names, shown) for channel in gain["units"]]
    charts.append(_trials_chart(book, gain, "chi2_per_n", names, shown))
    return [
        paragraph(said),
        _response(gain, shown),
        shared_legend([*shown.values(), Key("", floor_words(gain), "text", "dash")]),
        el("div", *charts, class_="pair"),
    ]


def _response(gain: Values, shown: Mapping[str, Key]) -> Node:
    """Error of every channel, absolute and as a share of its motion."""
    held = [gain["held_out"][which] for which in shown]
    rows: list[list[Entry]] = []
    for channel, (unit, scale) in response_units(gain).items():
        key = f"{channel}_rms"
        errors = [value(scale * w[key], 3) for w in (*held, gain["noise"])]
        rows.append(
            [channel, spelled(unit), *errors, *(value(100.0 * w[f"{channel}_nrmse"], 2) for w in held)]
        )
    rows.append(
        ["chi²/n", "", *(value(w["chi2_per_n"], 3) for w in held), Num("1"), *(Num(NONE) for _ in held)]
    )
    heads = _heads(shown)
    head = ["channel", "unit", *heads, "noise alone", *(f"{name} / motion [%]" for name in heads)]
    of = "foretold torques" if foretold_torques(gain) else "simulated response"
    return table(f"Error of the {of}, rms over the trials", head, rows)


def _trials_chart(book: Book, gain: Values, key: str, names: Sequence[str], shown: Mapping[str, Key]) -> Node:
    """One dot per trial, before and after, the noise floor dashed; ``key`` names the error."""
    trials, channel = gain["trials"], key.removesuffix("_rms")
    unit, scale, floor, title = "", 1.0, 1.0, "chi²/n"
    if channel != key:
        unit, scale = response_units(gain)[channel]
        unit = spelled(unit)
        floor, title = scale * gain["noise"][key], f"{channel} rms"
    traces, seen = [], [floor]
    for which, entry in shown.items():
        values = [None if t[which] is None else scale * t[which][key] for t in trials]
        seen += values
        text = [f"{name}, {entry.label}: {plain(v)} {unit}" for name, v in zip(names, values, strict=True)]
        traces.append(dots(range(len(trials)), values, entry, text, size=10))
    across, up = column_axis(_fitted(names)), log_axis(f"{title} [{unit}]" if unit else title, seen)
    plot = figure(traces, xaxis=across, yaxis=up, margin_b=26)
    plot.add_hline(floor)
    of, head = (
        ("foretold torques", "Foretold") if foretold_torques(gain) else ("simulated response", "Response")
    )
    label = f"{title} of every trial's {of}, before and after; the means are in the table."
    return chart(book, f"{head}: {title}", plot, height=230, label=label)


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
