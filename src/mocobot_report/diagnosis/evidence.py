"""Where the misfit sits: by channel, by trial and along the directions of single sources; and the evidence."""

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import Any

import numpy as np
import plotly.graph_objects as go

from discrepancy.numbers import Shown
from discrepancy.result.read import is_of_joints
from discrepancy.result.report import drawn, label, relation
from discrepancy.result.tables import blocks, diverged_sentences, lost, shown_units
from discrepancy.result.traces import Group, Trace, binned, group_units, groups, multiples, spectrum
from estimator.arrays import Array
from mocobot_report.blocks.book import Book, section, tabs
from mocobot_report.blocks.charts import Axis, axis, chart, dots, figure, line, log_axis, row_axis
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.legend import Key, shared_legend
from mocobot_report.blocks.numbers import NONE, percent, plain, spelled
from mocobot_report.blocks.prose import paragraph, tidy, verdict
from mocobot_report.blocks.series import Line, Panel, runs, stacked_chart, thinned, with_breaks
from mocobot_report.blocks.tables import Entry, Num, table, value
from mocobot_report.blocks.units import OF_JOINTS, QUANTITIES, spelled_text
from mocobot_report.diagnosis.keys import CLEAN, misfits
from mocobot_report.folder import Diagnosed

BAND = Key("", "±2 standard deviations of clean data", "band", "band")
LOG_FROM = 8.0
"""Multiples of clean noise above which an axis is logarithmic."""


def residual_sections(book: Book, diagnosed: Diagnosed, names: Sequence[str]) -> list[Node]:
    """Sections made of ``residuals.npz``; without it, what is missing."""
    traces = diagnosed.traces
    if not traces:
        said = (
            "residuals.npz is not in the folder, so there are no plots over time; diagnose again to get it."
        )
        return [section(book, "Residuals", verdict("warn", "No residuals", said))]
    grouped, named = groups(diagnosed.channels), bool(diagnosed.values["causes"])
    units = group_units(traces, grouped)
    trials = []
    for trace, name in zip(traces, names, strict=True):
        book.say(f"residuals of {name}")
        trials.append((name, _over_time(book, trace, name, grouped, units, named=named)))
    note = (
        "Recorded minus simulated, in physical units and in multiples of what clean data of these sensors would leave: "
        "1 is clean. Zooming one plot in time zooms those above and below."
    )
    over_time = [
        paragraph(note, kind="note"),
        tabs(book, "Trial", trials),
        _rms(traces, grouped, units, named=named),
    ]
    units = QUANTITIES | (OF_JOINTS if is_of_joints(diagnosed.values) else {})
    against = _against(book, traces, grouped, misfits(named=named, lines=True), units)
    return [
        section(book, "Residuals over time", over_time),
        section(book, "What the residual depends on", against),
    ]


def _over_time(
    book: Book, trace: Trace, name: str, grouped: Sequence[Group], units: Mapping[str, Shown], *, named: bool
) -> Node:
    run = runs(trace.time[: trace.moving], 1.0 / trace.rate_hz)
    views = {"as simulated": trace.before} | ({"with the named causes": trace.after} if named else {})
    note = "same scale as simulated and with the causes" if named else None
    physical = [
        _physical(book, trace, f"{name}: residual {view}", values, grouped, units, run, note)
        for view, values in views.items()
    ]
    multiples = _multiples(book, trace, name, grouped, run, named=named)
    if not named:
        return el("div", *physical, multiples, class_="pair")
    panels = [
        ("in physical units", el("div", *physical, class_="pair")),
        ("in multiples of clean noise", multiples),
    ]
    return el("div", *tabs(book, "Shown", panels))


def _physical(
    book: Book,
    trace: Trace,
    title: str,
    values: Array,
    grouped: Sequence[Group],
    units: Mapping[str, Shown],
    run: Array,
    note: str | None,
) -> Node:
    # Each component is labelled as in the last group that has it; a group of one has no components.
    several = [group.components for group in grouped if len(group.columns) > 1]
    labels = [next(filter(None, each[::-1])) for each in zip_longest(*several)] or ["value"]
    keys = [Key(f"c{k + 1}", label, f"c{k % 3 + 1}") for k, label in enumerate(labels)]
    panels = []
    for group in grouped:
        columns = list(group.columns)
        limit = _limit(trace.before[:, columns], trace.sigma[:, columns])
        unit, scale = units[group.unit]
        lines = _lines(trace, scale * values[:, columns], keys, run)
        time, sigma = with_breaks(trace.time[: trace.moving], trace.sigma[: trace.moving, columns], run)
        band = (time, 2.0 * scale * sigma.max(axis=1)) if trace.moving else None
        panels.append(Panel(group.name, spelled(unit), lines, (-scale * limit, scale * limit), band=band))
    legend = [*keys, BAND] if len(keys) > 1 else [BAND]
    label = f"{title}, every group of channels over time; rms values are in the table below."
    return stacked_chart(book, title, panels, keys=legend, note=note, label=label)


def _limit(values: Array, sigma: Array) -> float:
    return float(max(np.abs(values).max(initial=0.0), 2.5 * sigma.max(initial=0.0))) * 1.05 or 1.0


def _lines(trace: Trace, values: Array, keys: Sequence[Key], run: Array) -> list[Line]:
    """Columns over time: the series as lines, means of holds as points."""
    n = trace.moving
    time, shown = thinned(trace.time[:n], values[:n], run)
    columns = range(values.shape[1])
    lines = [Line(keys[k], time, shown[:, k]) for k in columns]
    if n < len(trace.time):
        lines += [Line(keys[k], trace.time[n:], values[n:, k], points=True) for k in columns]
    return lines


def _multiples(
    book: Book, trace: Trace, name: str, grouped: Sequence[Group], run: Array, *, named: bool
) -> Node:
    keys = misfits(named=named, lines=True)
    panels = []
    for group in grouped:
        lines, top = [], 1.0
        for key, white in zip(keys, (trace.white_before, trace.white_after), strict=True):
            shown = multiples(trace, white, group.columns)
            top = max(top, float(shown.max(initial=0.0)))
            lines += _lines(trace, shown[:, None], [key], run)
        log = top > LOG_FROM
        limits = (0.4, top) if log else (0.0, max(2.0, 1.1 * top))
        panels.append(Panel(group.name, "× clean", lines, limits, rule=1.0, log=log))
    title = f"{name}: rms over 1 s in multiples of clean noise"
    return stacked_chart(
        book, title, panels, keys=[*keys, CLEAN], note=None if named else "nothing is named",
        label=f"{title}, every group of channels over time.",
    )  # fmt: skip


def _rms(
    traces: Sequence[Trace], grouped: Sequence[Group], units: Mapping[str, Shown], *, named: bool
) -> Node:
    """Physical and whitened rms of every channel, over all trials."""
    rows: list[list[Entry]] = []
    for group in grouped:
        roots = [_roots(traces, column) for column in group.columns]
        unit, scale = units[group.unit]
        for k, ((before, after, *white), component) in enumerate(zip(roots, group.components, strict=True)):
            physical = [scale * root for root in (before, after)[: 1 + named]]
            names = [group.name if k == 0 else "", component if len(roots) > 1 else ""]
            rows.append([*names, spelled(unit), *map(value, physical + white)])
    head = ["channel", "", "unit", *(["before", "after"] if named else ["rms"])]
    head += ["before [× clean]", ("after" if named else "within tolerances") + " [× clean]"]
    return table("Rms of the residual over all trials", head, rows, groups=True, headers=2)


def _roots(traces: Sequence[Trace], column: int) -> list[float]:
    """Rms of one channel over all trials: before and after, both also whitened."""
    kinds = ("before", "after", "white_before", "white_after")
    together = (np.concatenate([getattr(t, kind)[:, column] for t in traces]) for kind in kinds)
    return [float(np.sqrt(np.mean(values**2))) for values in together]


def _against(
    book: Book,
    traces: Sequence[Trace],
    grouped: Sequence[Group],
    keys: Sequence[Key],
    units: Mapping[str, str],
) -> list[Node]:
    book.say("dependence of the residual")
    panels = []
    for quantity in [*traces[0].quantities, None]:
        unit = units.get(quantity or "", "")
        label = "frequency [Hz]" if quantity is None else f"{quantity} [{unit}]" if unit else quantity
        charts = [_dependence(book, traces, group, quantity, label, keys) for group in grouped]
        shown = [shared_legend([*keys, CLEAN]), el("div", *charts, class_="trio")]
        panels.append((quantity or "frequency", shown))
    note = (
        "Whitened rms in multiples of clean data, all trials together: in bins of equal counts against speed, "
        "position, load and the like; against frequency as a spectrum. What rises with load is elastic, what rises "
        "with speed rubs, a peak is something that swings."
    )
    return [paragraph(note, kind="note"), *tabs(book, "Against", panels)]


def _dependence(
    book: Book, traces: Sequence[Trace], group: Group, quantity: str | None, label: str, keys: Sequence[Key]
) -> Node:
    """Whitened rms of a group of channels against a quantity; against frequency where that is None."""
    lines, seen, columns = [], [1.0], list(group.columns)
    style = {"mode": "lines"} if quantity is None else {"mode": "lines+markers", "marker": {"size": 5}}
    for key, kind in zip(keys, ("white_before", "white_after"), strict=True):
        found = (
            spectrum(traces, kind, columns) if quantity is None else binned(traces, kind, columns, quantity)
        )
        if found is not None:
            hover = f"{key.label}<br>%{{x:.3g}}: %{{y:.3g}} × clean"
            lines.append(line(*found, key, hover, width=1.6, **style))
            seen += [float(found[1].min()), float(found[1].max())]
    vertical = (
        log_axis("× clean", [max(v, 0.05) for v in seen])
        if max(seen) > LOG_FROM
        else axis("× clean", range=[0.0, max(2.0, 1.12 * max(seen))], zeroline=False, nticks=5)
    )
    shown = figure(lines, xaxis=axis(label, zeroline=False, nticks=6), yaxis=vertical, margin_l=52)
    shown.add_hline(1.0, line_width=1)
    what = label.split(" [")[0]
    return chart(
        book, f"{group.name} against {what}", shown, height=210,
        label=f"Whitened rms of {group.name} against {what}, before and after.",
    )  # fmt: skip


Values = Mapping[str, Any]


def rollout_section(book: Book, values: Values) -> Node | None:
    """Free rollouts and the closed loop; None where the JSON has nothing of them."""
    rolled = values.get("rollouts")
    if rolled is None:
        return None
    inside: list[Node] = []
    if rolled["why_not"] is not None:
        inside.append(paragraph(tidy(f"Not rolled out freely: {rolled['why_not']}.")))
    else:
        inside += _free(rolled)
    loop = rolled["commanded"]
    if loop["why_not"] is not None:
        inside.append(paragraph(tidy(f"The closed loop was not simulated: {loop['why_not']}.")))
    else:
        inside += _loop(rolled, loop)
    return section(book, "Simulated from measured states", *inside)


def _free(rolled: Values) -> list[Node]:
    said = f"From measured states the model is let go under the logged torques, {blocks(rolled)}."
    more = [*diverged_sentences(rolled), *rolled["refused"]]
    if rolled["not_simulated"]:
        more.append(f"Not in the rollouts: {', '.join(rolled['not_simulated'])}.")
    rows: list[list[Entry]] = []
    for j in range(len(rolled["joints"])):
        for k, horizon in enumerate(rolled["horizons"]):
            sides = [
                None if horizon[which] is None else horizon[which]["rms"][j] for which in ("before", "after")
            ]
            share = None if horizon["removed"] is None else horizon["removed"][j]
            rows.append(
                [
                    _named(rolled, j) if not k else "",
                    value(horizon["seconds"], 2),
                    *_row(rolled, j, sides, share, named=horizon["after"] is not None),
                    Num(str(horizon["starts"])),
                ]
            )
    head = ["joint", "ahead [s]", *_heads(named=rolled["horizons"][0]["after"] is not None), "starts"]
    note = "rms over the starts; a dash where more than half of the rollouts diverged"
    return [
        paragraph(tidy(" ".join([said, *more]))),
        table("Error of the position after free rollouts", head, rows, note=note, groups=True),
    ]


def _loop(rolled: Values, loop: Values) -> list[Node]:
    named = loop["after"] is not None
    rows: list[list[Entry]] = []
    for j in range(len(rolled["joints"])):
        sides = [loop["before"][j], loop["after"][j] if named else None]
        rows.append(
            [_named(rolled, j), *_row(rolled, j, sides, loop["removed"][j] if named else None, named=named)]
        )
    count = len(loop["blocks"])
    missing = [
        f"of the {word} model {lost(loop['blocks'], which)} of {count} blocks diverged and are left out"
        for which, word in (("before", "given"), ("after", "extended"))
        if lost(loop["blocks"], which)
    ]
    note = "; ".join(["rms over the blocks under their logged commands", *missing])
    return [table("Error of the position in closed loop", ["joint", *_heads(named=named)], rows, note=note)]


def _heads(*, named: bool) -> list[str]:
    return ["before", "after", "removed"] if named else ["error"]


def _named(rolled: Values, j: int) -> str:
    return f"{rolled['joints'][j]} [{spelled_text(shown_units(rolled)[rolled['units'][j]][0])}]"


def _row(
    rolled: Values, j: int, sides: list[float | None], share: float | None, *, named: bool
) -> list[Entry]:
    scale = shown_units(rolled)[rolled["units"][j]][1]
    numbers: list[Entry] = [
        Num(NONE) if x is None else value(scale * x, 3) for x in sides[: 2 if named else 1]
    ]
    return [*numbers, *([Num(NONE if share is None else percent(share))] if named else [])]


NATS = "evidence [nats]"
NEEDED = Key("needed", "needed to be named", "text", "circle-open")
RELATIONS = (
    Key("named", "named", "before", "square"),
    Key("family", "same family", "after", "circle"),
    Key("other", "other", "paper", "diamond"),
)


def evidence_sections(book: Book, diagnosed: Diagnosed, names: Sequence[str]) -> list[Node]:
    """Misfit by place, and the evidence for the strongest candidates."""
    values = diagnosed.values
    keys = misfits(named=bool(values["causes"]))
    nominal, left = values["residual"]["nominal"]["signature"], values["residual"]["signature"]
    charts = []
    if nominal.get("channel") and left.get("channel"):
        charts.append(_misfit(book, "Misfit by channel", (nominal["channel"], left["channel"]), {}, keys))
    if nominal.get("trial") and left.get("trial") and len(nominal["trial"]) > 1:
        shown = dict(zip(values["recordings"], names, strict=True))
        charts.append(_misfit(book, "Misfit by trial", (nominal["trial"], left["trial"]), shown, keys))
    if nominal.get("along"):
        charts.append(_along(book, "Where the misfit as simulated points", nominal["along"], "before"))
    if left.get("along") and values["verdict"] != "consistent":
        charts.append(_along(book, "Where what is left points", left["along"], "after"))
    said = f"As simulated: {tidy(nominal['sentence'], inside=True)}"
    return [*_section(book, "Where the misfit sits", said, charts), *_strongest_sections(book, values)]


def _section(book: Book, title: str, said: str, charts: Sequence[Node]) -> list[Node]:
    if not charts:
        return []
    return [section(book, title, paragraph(said, kind="note"), el("div", *charts, class_="pair"))]


def _misfit(
    book: Book, title: str, both: Sequence[Values], shown: Mapping[str, str], keys: Sequence[Key]
) -> Node:
    """chi2/n of every channel or trial, before and after."""
    rows = list(both[0])
    names = [shown.get(row, row) for row in rows]
    traces, seen = [], [1.0]
    for key, values in zip(keys, both, strict=True):
        numbers = [values.get(row) for row in rows]
        seen += numbers
        text = [f"{name}, {key.label}: {plain(v)}" for name, v in zip(names, numbers, strict=True)]
        traces.append(dots(numbers, range(len(rows)), key, text))
    label = f"{title}: chi-square per number, before and after, one row each."
    across = log_axis("chi²/n", seen)
    return _rows_chart(book, title, traces, names, across, label, rule=1.0, keys=[*keys, CLEAN])


def _along(book: Book, title: str, shares: Values, colour: str) -> Node:
    """Share of the squared residual along single sources."""
    names, shown = list(shares), [100.0 * v for v in shares.values()]
    bars = go.Bar(
        x=shown, y=list(range(len(names))), orientation="h", width=0.62, meta=colour, cliponaxis=False,
        text=[percent(v) for v in shares.values()], textposition="auto", insidetextanchor="end",
        hovertemplate="%{text}<extra></extra>",
    )  # fmt: skip
    across = axis("share of the misfit [%]", range=[0, 1.14 * max(shown)], nticks=5)
    said = ", ".join(f"{name} {percent(v)}" for name, v in shares.items())
    label = f"{title}: share of the squared residual along single sources: {said}"
    note = "share of the squared residual along what one source alone can do; sources overlap, so shares do not add up"
    return _rows_chart(book, title, [bars], names, across, label, row_px=30, note=note)


def _rows_chart(
    book: Book, title: str, traces: Sequence[go.Scatter | go.Bar], names: Sequence[str], across: Axis, label: str, *,
    rule: float | None = None, row_px: int = 24, left_px: int = 120, most: int = 26, font_px: int = 10, **more: Any,
) -> Node:  # fmt: skip
    """One row per name, of up to ``most`` letters in ``left_px`` pixels; a dashed line at ``rule``."""
    shown = figure(traces, xaxis=across, yaxis=row_axis(names, most), margin_l=left_px)
    if rule is not None:
        shown.add_vline(rule)
    narrow = {"yaxis.tickfont.size": font_px, "margin.l": min(left_px, 155)}
    return chart(book, title, shown, height=row_px * len(names) + 76, label=label, narrow=narrow, **more)


def _strongest_sections(book: Book, values: Values) -> list[Node]:
    """The evidence for the strongest candidates, before and after what is named is in the model."""
    evidence = values["evidence"]
    panels = {"Nothing is named yet": evidence["before"], "What is named is in the model": evidence["after"]}
    worth = {title: drawn(entries or []) for title, entries in panels.items()}
    seen = [entry[key] for entries in worth.values() for entry in entries for key in ("nats", "needed")]
    charts = [
        _strongest(book, title, entries, values["causes"], log_axis(NATS, seen))
        for title, entries in worth.items()
        if entries
    ]
    said = (
        "By how much the recordings are likelier if a cause is there besides what is in the model, in nats, for the "
        "strongest candidates; what is there leaves a mark in its relatives, too. Rings: what it takes to be named. "
        + ("Both plots have the same logarithmic scale." if len(charts) > 1 else "The scale is logarithmic.")
    )
    return _section(book, "Evidence", said, charts)


def _strongest(
    book: Book, title: str, entries: Sequence[Values], causes: Sequence[Values], across: Axis
) -> Node:
    names, nats = [label(entry) for entry in entries], [entry["nats"] for entry in entries]
    needed = [entry["needed"] for entry in entries]
    rings = [f"{name}: named from {plain(n, 2)} nats" for name, n in zip(names, needed, strict=True)]
    traces, keys = [dots(needed, range(len(names)), NEEDED, rings, size=7)], []
    for key in RELATIONS if causes else RELATIONS[-1:]:
        rows = [k for k, entry in enumerate(entries) if not causes or relation(entry, causes) == key.group]
        if rows:
            keys.append(key)
            text = [f"{names[k]}: {plain(nats[k])} nats, named from {plain(needed[k], 2)}" for k in rows]
            traces.append(dots([nats[k] for k in rows], rows, key, text))
    said = ", ".join(f"{name} {plain(n)}" for name, n in zip(names, nats, strict=True))
    return _rows_chart(
        book, title, traces, names, across, f"{title}: evidence of the strongest candidates in nats, {said}",
        left_px=190, most=40, font_px=9, keys=[*keys, NEEDED] if causes else [NEEDED],
    )  # fmt: skip
