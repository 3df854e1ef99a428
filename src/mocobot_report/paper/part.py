"""The part of the page on the paper's experiment: the answer, Tables II-V beside ours, trials, payloads."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import cycle, groupby

import numpy as np
import plotly.graph_objects as go

from estimator.estimate.result import PayloadEstimate
from mocobot_report.blocks import palette
from mocobot_report.blocks.book import Book, section, tabs
from mocobot_report.blocks.charts import chart, column_axis, dots, figure, log_axis, row_axis
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.legend import Key
from mocobot_report.blocks.numbers import PLUS_MINUS, about, plain, spelled
from mocobot_report.blocks.pictures import ASPECT
from mocobot_report.blocks.prose import bullets, folded, paragraph, tiles, verdict
from mocobot_report.blocks.tables import Entry, Num, distance, mass, moment, place, quantity, table, value
from mocobot_report.blocks.units import spelled_text
from mocobot_report.folder import Paper
from mocobot_sim.paper.fits import ONE_FIT, SELF_CALIBRATED, TRANSFER
from mocobot_sim.paper.published import payload_truth
from mocobot_sim.paper.scoring import SPRING_SCALE
from mocobot_sim.paper.tables import (
    BY_ENCODERS,
    MOMENTS,
    Cell,
    PaperTable,
    Row,
    paper_tables,
    spring_share,
    summary_table,
)
from mocobot_sim.trial.rows import ROD_LIMIT_M, WELD_LIMIT_M, WELD_LIMIT_RAD
from mocobot_view.pictures import team_shot

FITS = {
    ONE_FIT: ("nominal", "circle-open"), SELF_CALIBRATED: ("c1", "triangle-up"), TRANSFER: ("c1", "triangle-up-open"),
}  # fmt: skip
"""Colour and marker of each column of fits."""
LEAST = 1e-7
"""Errors below this share of a unit are drawn at it: a logarithmic axis has no zero."""
NARROW = {"margin.l": 46, "xaxis.tickfont.size": 9}


def keys(columns: Sequence[str]) -> list[Key]:
    """Legend of the paper's column, the presets' and the fits'; presets that nobody knows yet get what is left."""
    left = zip(cycle(palette.OTHER_COLOURS), cycle(palette.OTHER_MARKERS))
    known = {name: (name, marker) for name, marker in palette.PRESETS.items()} | FITS
    return [Key(name, name, *(known[name] if name in known else next(left))) for name in columns]


def table_chart(book: Book, table: PaperTable, title: str, note: str) -> Node:
    """One column per row of a table of one unit, one dot per preset; whiskers reach up by the spread."""
    legend, rows, unit = keys(table.columns), table.rows, spelled_text(f"[{table.rows[0].unit}]")
    traces, seen = [], []
    for k, key in enumerate(legend):
        cells = [row.cells[k] for row in rows]
        values, spreads = [_drawn(c.value) for c in cells], [c.spread or 0.0 for c in cells]
        seen += [
            v + s for v, spread in zip(values, spreads, strict=True) if v is not None for s in (0.0, spread)
        ]
        text = [
            f"{key.label}, payload ({row.payload}), {row.quantity}: {plain(c.value)}"
            + ("" if c.spread is None else f" {PLUS_MINUS} {plain(c.spread, 2)}")
            + f" {unit}"
            for row, c in zip(rows, cells, strict=True)
        ]
        # Downward a whisker has no meaning on a logarithmic axis.
        up = (
            {"array": spreads, "arrayminus": [0.0] * len(rows), "thickness": 1.3, "width": 3}
            if any(spreads)
            else None
        )
        traces.append(
            dots(
                [n + _aside(k, legend, min(0.16, 0.85 / len(legend))) for n in range(len(rows))],
                values,
                key,
                text,
                error_y=up,
            )
        )
    shown = _by_payload(traces, [(row.payload, row.quantity) for row in rows], f"error {unit}", seen)
    label = f"{title}. The numbers are in Table {table.number} below."
    return chart(book, title, shown, height=330, label=label, keys=legend, note=note, narrow=NARROW)


def summary_chart(book: Book, table: PaperTable) -> Node:
    """The largest errors in percent or degrees, one line per quantity."""
    rows = [row for row in table.rows if row.unit in ("%", "deg")]
    names = [f"{row.quantity} [{row.unit}]" + (f", {row.frames}" if row.frames else "") for row in rows]
    wide = any(row.frames for row in rows)
    legend, traces, seen = keys(table.columns), [], []
    for k, key in enumerate(legend):
        values = [row.cells[k].value for row in rows]
        text = [f"{key.label}, {name}: {plain(v)}" for name, v in zip(names, values, strict=True)]
        traces.append(dots([*map(_drawn, values)], range(len(rows)), key, text, size=11))
        seen += map(_drawn, values)
    shown = figure(
        traces, xaxis=log_axis("largest error", seen),
        yaxis=row_axis(names, 40), margin_l=245 if wide else 150,
    )  # fmt: skip
    return chart(
        book, "Largest errors at a glance", shown, height=60 + 30 * len(rows), keys=legend,
        narrow={"yaxis.tickfont.size": 8 if wide else 10} | ({"margin.l": 165} if wide else {}),
        label="Largest error of every quantity, the paper's beside ours; the numbers are in the first table.",
    )  # fmt: skip


def trial_chart(book: Book, estimates: Mapping[tuple[str, str], PayloadEstimate]) -> Node | None:
    """Errors of the principal moments from every single recording."""
    payloads = list(dict.fromkeys(payload for payload, _ in estimates))
    legend, traces, seen = keys(list(dict.fromkeys(preset for _, preset in estimates))), [], []
    for p, key in enumerate(legend):
        x, y, text = [], [], []
        for k, payload in enumerate(payloads):
            truth = payload_truth(payload).principal_moments
            found = estimates.get((payload, key.group))
            for recording in () if found is None else found.recordings:
                if recording.inertia is None:
                    continue
                share = 100.0 * np.abs(recording.inertia.principal.moments / truth - 1.0)
                x += [3 * k + m + _aside(p, legend, 0.22) for m in range(3)]
                y += [_drawn(float(s)) for s in share]
                text += [
                    f"{key.label}, payload ({payload}), {recording.trial} trial, {name}: {plain(float(s))} %"
                    for name, s in zip(MOMENTS, share, strict=True)
                ]
        seen += y
        traces.append(dots(x, y, key, text, size=7, opacity=0.8))
    if not seen:
        return None
    columns = [(payload, name) for payload in payloads for name in MOMENTS]
    return chart(
        book, "Principal moments from every trial on its own", _by_payload(traces, columns, "|error| [%]", seen),
        height=330, keys=legend, narrow=NARROW,
        label="Relative error of the principal moments of inertia that each recording alone gives.",
        note="one dot per recording with motion; Table V averages them with their signs",
    )  # fmt: skip


def _drawn(value: float | None) -> float | None:
    return None if value is None else max(value, LEAST)


def _aside(k: int, legend: Sequence[Key], apart: float) -> float:
    """How far the dots of an entry of the legend stand from the middle of their column."""
    return apart * (k - (len(legend) - 1) / 2)


def _by_payload(
    traces: Sequence[go.Scatter], columns: Sequence[tuple[str, str]], title: str, seen: Iterable[float | None]
) -> go.Figure:
    """Columns of (payload, quantity) over a logarithmic axis: the payload named once, every second one shaded."""
    names, shaded = [], []
    for k, (payload, group) in enumerate(groupby(columns, key=lambda column: column[0])):
        each, start = list(group), len(names)
        for n, (_, what) in enumerate(each):
            head = f"<b>({payload})</b>" if n == len(each) // 2 else "<b></b>"
            names.append(f"{what}<br>{head}" if len(each) > 1 else head)
        shaded += [(start - 0.5, len(names) - 0.5)] if k % 2 else []
    shown = figure(traces, xaxis=column_axis(names), yaxis=log_axis(title, seen))
    for x0, x1 in shaded:
        shown.add_vrect(x0, x1, layer="below", line_width=0, opacity=0.5)
    return shown


SENSORS = {
    "ideal": "exact sensors",
    "nominal": "16-bit encoders and noisy torques in steps of 0.01 N m",
    "uncalibrated": "the same on robots with calibration errors of about 1 deg, 2 % of spring stiffness and 1 mm",
    ONE_FIT: "the nominal team, estimated by one fit of three trials in place of the paper's stages",
    SELF_CALIBRATED: "the uncalibrated team, calibrated on three of its own recordings and nothing else",
    TRANSFER: "the uncalibrated team as one payload has calibrated it, carrying the others",
}


_FRAMES = "each grasp frame turned by the zero of its last gimbal axis, which nothing measured can tell"


def title(paper: Paper) -> str:
    """What it is of."""
    return "The paper's experiment, simulated"


def answer(paper: Paper) -> list[Node]:
    """What came out, in a few sentences."""
    summary, payloads = summary_table(paper.scores), _payloads(paper)
    names = ", ".join(f"({name})" for name in payloads)
    lede = paragraph(
        f"Simulated teams of three mobile cobots carry payload{'s' * (len(payloads) > 1)} {names} and estimate grasps, "
        "mass, centre of mass and inertia from joint sensors alone. The errors stand beside those that Zhang, Liu, "
        "Elwin, Freeman and Lynch measured on hardware (IEEE RA-L 2025, Tables II-V).",
        kind="lede",
    )
    against = [
        item
        for name in summary.columns
        if name != "paper" and (item := _calibrated(paper, name) or _against(summary, name)) is not None
    ]
    box = verdict("plain", "Our largest errors beside the paper's", bullets(against))
    return [lede, box, _trust(paper), _summary(summary)]


def _payloads(paper: Paper) -> list[str]:
    return list(next(iter(paper.scores.values())))


def _against(summary: PaperTable, preset: str) -> Node | None:
    """How many times smaller or larger the largest errors are than the published ones."""
    k = summary.columns.index(preset)
    pairs = [(row.cells[0].value, row.cells[k].value) for row in summary.rows]
    ratios = [published / ours for published, ours in pairs if published and ours]
    if not ratios:
        return None
    low, high = min(ratios), max(ratios)
    if low >= 1.0:
        said = f"{about(low)} to {about(high)} times smaller than the paper's"
    elif high <= 1.0:
        said = f"{about(1 / high)} to {about(1 / low)} times the paper's"
    else:
        said = f"between {about(1 / high)} and {about(1 / low)} times the paper's"
    return el("span", el("b", preset), f" ({SENSORS.get(preset, 'sensors of that name')}): {said}.")


def _calibrated(paper: Paper, column: str) -> Node | None:
    """What a team that was calibrated comes to; None for other columns."""
    entries = [entry for entry in paper.scores[column].values() if entry is not None]
    shares = [entry[SPRING_SCALE] for entry in entries if SPRING_SCALE in entry]
    table = summary_table(paper.scores)
    if not any(share["percent"] for share in shares) or not table.part("deg", frames=BY_ENCODERS).rows:
        return None
    at = table.columns.index(column)

    def largest(name: str, unit: str, frames: str = BY_ENCODERS) -> str:
        return f"{plain(table.part(unit, name, frames).rows[0].cells[at].value, 2)} {unit}"

    beyond = max(share[f"{name}_percent"] for share in shares for name in ("m", *MOMENTS))
    return el(
        "span",
        el("b", column),
        f" ({SENSORS.get(column, 'calibrated')}): in the frames that the encoders define, grasps within "
        f"{largest('grasp rotation', 'deg')} and {largest('grasp position', 'mm')}, centre of mass within "
        f"{largest('centre of mass', 'mm')}; mass and inertia within {plain(beyond, 2)} % beyond the springs' common "
        f"scale ({plain(max(abs(share['percent']) for share in shares), 2)} %). Against the CAD, grasps are off by up "
        f"to {largest('grasp rotation', 'deg', '')}: so far the zeros of the last gimbal axes turn them, which no "
        "carry decides, nor the springs' common scale.",
    )


def _trust(paper: Paper) -> Node:
    if not paper.trials:
        return verdict(
            "warn",
            "The trials' checks are not here",
            "trials.json is missing from the folder, so nothing says whether the simulated physics held.",
        )
    rod, weld, angle = (
        max(t[key] for t in paper.trials) for key in ("rod_error_m", "weld_error_m", "weld_error_deg")
    )
    most_deg, count = float(np.rad2deg(WELD_LIMIT_RAD)), len(paper.trials)
    good = rod <= ROD_LIMIT_M and weld <= WELD_LIMIT_M and angle <= most_deg
    return verdict(
        "good" if good else "bad",
        f"All {count} trials can be trusted" if good else f"Some of the {count} trials cannot be trusted",
        f"Their rods opened by at most {plain(1e3 * rod, 2)} mm (limit {1e3 * ROD_LIMIT_M:g} mm), grasps by "
        f"{plain(1e3 * weld, 2)} mm (limit {1e3 * WELD_LIMIT_M:g} mm) and {plain(angle, 2)} deg "
        f"(limit {most_deg:g} deg).",
    )


def sections(book: Book, paper: Paper) -> list[Node]:
    """Everything below the answer."""
    book.say("paper's tables")
    two, three, four, five = paper_tables(paper.scores)
    above, one_set = "whisker: mean + standard deviation", "one set of six static holds"
    share = spring_share(paper.scores)
    scale = f"; {plain(share, 2)} % of it in calibrated teams: the springs' common scale" if share else ""

    def shown(rows: PaperTable, title: str, note: str) -> Node | None:
        return table_chart(book, rows, title, note) if rows.rows else None

    grasps = [
        shown(two.part("deg"), "Table II: rotation error [deg]", above),
        shown(two.part("deg", frames=BY_ENCODERS), "Table II: rotation error, encoder frames [deg]", _FRAMES),
        _table(two),
        shown(three.part("%"), "Table III: position error [% of |p|]", above),
        shown(three.part("%", frames=BY_ENCODERS), "Table III: position error, encoder frames [% of |p|]", _FRAMES),
        _table(three),
    ]  # fmt: skip
    holds = [
        shown(four.part("%", "m"), "Table IV: mass error [%]", one_set + scale),
        shown(four.part("%", "p1c"), "Table IV: centre-of-mass error [% of |p1c|]", one_set),
        shown(
            four.part("%", "p1c", BY_ENCODERS),
            "Table IV: centre-of-mass error, encoder frames [% of |p1c|]",
            _FRAMES,
        ),
    ]
    inertia = [
        shown(five.part("%"), "Table V: |mean error| of the principal moments [%]",
              "whisker: plus the standard deviation of the estimates" + scale),
        _table(five), trial_chart(book, paper.estimates),
    ]  # fmt: skip
    teams = [(f"Payload ({name})", partial(team_shot, name, ASPECT)) for name in _payloads(paper)]
    outline = [
        ("largest", "Largest errors", summary_chart(book, summary_table(paper.scores))),
        ("grasps", "Grasps", grasps),
        ("mass", "Mass and centre of mass", [el("div", *holds, class_="pair"), _table(four)]),
        ("inertia", "Inertia", inertia),
        ("estimates", "Estimates against the truth", _estimates(book, paper) if paper.estimates else None),
        ("trials", "Trial checks", _trials(paper) if paper.trials else None),
        ("teams", "The teams and their payloads", book.gallery.ask(teams)),
    ]
    return [
        section(book, name, blocks, identity=identity)
        for identity, name, blocks in outline
        if blocks is not None
    ]


def _table(shown: PaperTable) -> Node:
    rows: list[list[Entry]] = []
    last = ""
    for row in shown.rows:
        head = f"({row.payload})" if row.payload != last else ""
        rows.append([head, _named(row), spelled(row.unit), *map(_cell, row.cells)])
        last = row.payload
    caption = f"Table {shown.number}. {shown.title}".replace("[kg m^2]", "[kg m²]")
    head, note = ["payload", "", "unit", *shown.columns], shown.note.replace("+-", "±")
    return table(caption, head, rows, note=note, headers=2, groups=True)


def _summary(shown: PaperTable) -> Node:
    rows = [[_named(row), spelled(row.unit), *map(_cell, row.cells)] for row in shown.rows]
    note = "the largest mean error of every kind, over payloads and pairs or moments"
    note += f"; {shown.note}" if shown.note else ""
    return table("Largest error over the payloads", ["", "unit", *shown.columns], rows, note=note)


def _named(row: Row) -> Node:
    return quantity(f"{row.quantity}, {row.frames}" if row.frames else row.quantity)


def _cell(cell: Cell) -> Num:
    return Num(plain(cell.value, 2), "" if cell.spread is None else plain(cell.spread, 2))


def _estimates(book: Book, paper: Paper) -> list[Node]:
    payloads = dict.fromkeys(payload for payload, _ in paper.estimates)
    panels = [(f"payload ({payload})", _against_truth(paper, payload)) for payload in payloads]
    note = paragraph(
        "As the paper's stages have it: value ± standard error; the truth is Table I of the paper. "
        "Standard errors cover noise and quantisation, not "
        "calibration: on uncalibrated robots they are far too small.",
        kind="note",
    )
    return [note, *tabs(book, "Payload", panels)]


def _against_truth(paper: Paper, payload: str) -> Node:
    truth = payload_truth(payload)
    found = {preset: e for (p, preset), e in paper.estimates.items() if p == payload}
    rows: list[list[Entry]] = [["mass", "kg", value(truth.mass, 5), *map(mass, found.values())]]
    for k, name in enumerate("xyz"):
        true = value(1e3 * float(truth.p_1c[k]), 4)
        rows.append([quantity(f"p_1c {name}"), "mm", true, *(place(e, k) for e in found.values())])
    for k in range(3):
        true = value(float(truth.principal_moments[k]), 4)
        rows.append([f"principal moment {k + 1}", "kg m²", true, *(moment(e, k) for e in found.values())])
    for j in (2, 3):
        true = value(1e3 * float(np.linalg.norm(truth.T(1, j)[:3, 3])), 5)
        rows.append([quantity(f"|p_1{j}|"), "mm", true, *(distance(e, 1, j) for e in found.values())])
    return table(f"Payload ({payload})", ["", "unit", "truth", *found], rows)


def _trials(paper: Paper) -> list[Node]:
    trials, micro = paper.trials, 1e6
    columns = {
        "rotation [deg]": ("rotation_deg", 1.0), "torque [N m]": ("torque_Nm", 1.0),
        "rod error [µm]": ("rod_error_m", micro), "weld error [µm]": ("weld_error_m", micro),
        "weld angle [µdeg]": ("weld_error_deg", micro),
    }  # fmt: skip
    worst = {key: max(t[key] for t in trials) for key, _ in columns.values()}
    rod, weld = (f"≤ {plain(micro * worst[key], 2)} µm" for key in ("rod_error_m", "weld_error_m"))
    shown = tiles([
        ("trials", str(len(trials)), ""),
        ("payload rotation", f"≤ {plain(worst['rotation_deg'])} deg", ""),
        ("spring torque", f"≤ {plain(worst['torque_Nm'])} N m", ""),
        ("rod error", rod, f"limit {micro * ROD_LIMIT_M:g} µm"),
        ("grasp error", weld, f"limit {micro * WELD_LIMIT_M:g} µm"),
    ])  # fmt: skip
    rows = [
        [t["name"], *(value(scale * t[k], mark=t[k] == worst[k]) for k, scale in columns.values())]
        for t in trials
    ]
    note = "payload, kind, number, least ideal preset; largest in bold"
    listed = table("Extremes of every trial", ["trial", *columns], rows, note=note)
    return [shown, folded(f"Every trial ({len(trials)})", listed)]
