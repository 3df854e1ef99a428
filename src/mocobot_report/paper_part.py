"""The part of the page on the paper's experiment: the answer, Tables II-V beside ours, trials, payloads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimator.paper_tables import payload_truth
from mocobot_report.blocks import (
    Entry,
    Num,
    folded,
    measurement,
    paragraph,
    section,
    symbols,
    table,
    tabs,
    tiles,
    value,
    verdict,
)
from mocobot_report.book import Book
from mocobot_report.folder import Paper
from mocobot_report.html import Node, el
from mocobot_report.numbers import NONE, plain, spelled
from mocobot_report.paper_charts import summary_chart, table_chart, trial_chart
from mocobot_report.pictures import ASPECT
from mocobot_sim.paper.tables import Cell, PaperTable, paper_tables, summary_table
from mocobot_sim.pictures.shots import team_shot
from mocobot_sim.trial import ROD_LIMIT_M, WELD_LIMIT_M, WELD_LIMIT_RAD

SENSORS = {
    "ideal": "exact sensors",
    "nominal": "16-bit encoders and noisy torques in steps of 0.01 N m",
    "uncalibrated": "the same on robots with calibration errors of about 1 deg, 2 % of spring stiffness and 1 mm",
}


def title(paper: Paper) -> str:
    """What it is of."""
    return "The paper's experiment, simulated"


def answer(paper: Paper) -> list[Node]:
    """What came out, in a few sentences."""
    summary = summary_table(paper.scores)
    presets = [name for name in summary.columns if name != "paper"]
    payloads = list(next(iter(paper.scores.values())))
    names = ", ".join(f"({name})" for name in payloads)
    out = [
        paragraph(
            f"Simulated teams of three mobile cobots carry {'payload' if len(payloads) == 1 else 'payloads'} {names} and "
            "estimate grasps, mass, centre of mass and inertia from joint sensors alone. The errors stand beside those "
            "that Zhang, Liu, Elwin, Freeman and Lynch measured on hardware (IEEE RA-L 2025, Tables II-V).",
            kind="lede",
        )
    ]
    sentences = [text for name in presets if (text := _against(summary, name))]
    out.append(verdict("plain", "Our errors beside the paper's", *sentences))
    out.append(_trust(paper))
    return out


def _against(summary: PaperTable, preset: str) -> str | None:
    """How many times smaller or larger the largest errors are than the published ones."""
    k = summary.columns.index(preset)
    ratios = [
        row.cells[0].value / row.cells[k].value
        for row in summary.rows
        if row.cells[0].value and row.cells[k].value
    ]
    if not ratios:
        return None
    low, high = min(ratios), max(ratios)
    what = SENSORS.get(preset, "sensors of that name")
    if low >= 1.0:
        return f"{preset} ({what}): largest errors {plain(low, 2)} to {plain(high, 2)} times smaller than the paper's."
    if high <= 1.0:
        return f"{preset} ({what}): largest errors {plain(1 / high, 2)} to {plain(1 / low, 2)} times the paper's."
    return (
        f"{preset} ({what}): largest errors between {plain(1 / high, 2)} and {plain(1 / low, 2)} times the paper's."
    )


def _trust(paper: Paper) -> Node:
    if not paper.trials:
        return verdict(
            "warn",
            "The trials' checks are not here",
            "trials.json is missing from the folder, so nothing says whether the simulated physics held.",
        )
    rod = max(t["rod_error_m"] for t in paper.trials)
    weld = max(t["weld_error_m"] for t in paper.trials)
    angle = max(t["weld_error_deg"] for t in paper.trials)
    limits = (ROD_LIMIT_M, WELD_LIMIT_M, float(np.rad2deg(WELD_LIMIT_RAD)))
    good = rod <= limits[0] and weld <= limits[1] and angle <= limits[2]
    count = len(paper.trials)
    held = f"All {count} trials can be trusted" if good else f"Some of the {count} trials cannot be trusted"
    return verdict(
        "good" if good else "bad",
        held,
        f"Their rods opened by at most {plain(1e3 * rod, 2)} mm (limit {1e3 * limits[0]:g} mm), grasps by "
        f"{plain(1e3 * weld, 2)} mm (limit {1e3 * limits[1]:g} mm) and {plain(angle, 2)} deg (limit {limits[2]:g} deg).",
    )


def sections(book: Book, paper: Paper) -> list[Node]:
    """Everything below the answer."""
    book.say("paper's tables")
    summary = summary_table(paper.scores)
    two, three, four, five = paper_tables(paper.scores)
    whisker = "whisker: mean + standard deviation"
    blocks = [
        section(book, "Largest errors", summary_chart(book, summary), _summary(summary), identity="largest"),
        section(
            book, "Grasps", table_chart(book, two, "Table II: rotation error [deg]", whisker), _table(two),
            table_chart(book, three.part("%"), "Table III: position error [% of |p|]", whisker), _table(three),
            identity="grasps",
        ),
        section(
            book, "Mass and centre of mass", *_table_four(book, four), _table(four), identity="mass",
        ),
        section(
            book, "Inertia",
            table_chart(book, five.part("%"), "Table V: |mean error| of the principal moments [%]",
                        "whisker: plus the standard deviation of the estimates"),
            _table(five), trial_chart(book, paper.estimates), identity="inertia",
        ),
    ]  # fmt: skip
    if paper.estimates:
        blocks.append(
            section(book, "Estimates against the truth", *_estimates(book, paper), identity="estimates")
        )
    if paper.trials:
        blocks.append(section(book, "Trial checks", *_trials(paper), identity="trials"))
    payloads = list(next(iter(paper.scores.values())))
    shots = [(f"Payload ({name})", lambda name=name: team_shot(name, ASPECT)) for name in payloads]
    blocks.append(section(book, "The teams and their payloads", book.gallery.ask(shots), identity="teams"))
    return blocks


def _table_four(book: Book, four: PaperTable) -> list[Node]:
    kinds = (("m", "Table IV: mass error [%]"), ("p1c", "Table IV: centre-of-mass error [% of |p1c|]"))
    charts = []
    for quantity, title in kinds:
        rows = tuple(row for row in four.part("%").rows if row.quantity == quantity)
        part = PaperTable(four.number, four.title, four.note, four.columns, rows)
        charts.append(table_chart(book, part, title, "one set of six static holds"))
    return [el("div", *charts, class_="pair")]


def _table(shown: PaperTable) -> Node:
    rows: list[list[Entry]] = []
    last = ""
    for row in shown.rows:
        head = f"({row.payload})" if row.payload != last else ""
        rows.append([head, symbols_entry(row.quantity), spelled(row.unit), *map(_cell, row.cells)])
        last = row.payload
    caption = f"Table {shown.number}. {shown.title}".replace("[kg m^2]", "[kg m²]")
    return table(
        caption, ["payload", "", "unit", *shown.columns], rows, note=shown.note.replace("+-", "±"), headers=2,
        groups=True,
    )  # fmt: skip


def _summary(shown: PaperTable) -> Node:
    rows: list[list[Entry]] = [
        [row.quantity, spelled(row.unit), *map(_cell, row.cells)] for row in shown.rows
    ]
    return table(
        "Largest error over the payloads", ["", "unit", *shown.columns], rows,
        note="the largest mean error of every kind, over payloads and pairs or moments",
    )  # fmt: skip


def _cell(cell: Cell) -> Num:
    return Num(plain(cell.value, 2), "" if cell.spread is None else plain(cell.spread, 2))


def symbols_entry(text: str) -> Node:
    """A quantity with its indices lowered."""
    return el("span", *symbols(text))


def _estimates(book: Book, paper: Paper) -> list[Node]:
    payloads = list(dict.fromkeys(payload for payload, _ in paper.estimates))
    panels = [(f"payload ({payload})", _against_truth(paper, payload)) for payload in payloads]
    note = paragraph(
        "Value ± standard error; the truth is Table I of the paper. Standard errors cover noise and quantisation, not "
        "calibration: on uncalibrated robots they are far too small.",
        kind="note",
    )
    return [note, *tabs(book, "Payload", panels)]


def _against_truth(paper: Paper, payload: str) -> Node:
    truth = payload_truth(payload)
    presets = [preset for p, preset in paper.estimates if p == payload]
    found = [paper.estimates[payload, preset] for preset in presets]
    rows: list[list[Entry]] = [
        ["mass", "kg", value(truth.mass, 5)]
        + [measurement(e.mass.mass, e.mass.se) if e.mass else Num(NONE) for e in found]
    ]
    for k, name in enumerate("xyz"):
        row: list[Entry] = [symbols_entry(f"p_1c {name}"), "mm", value(1e3 * truth.p_1c[k], 4)]
        for e in found:
            known = e.p_1c is not None and e.p_1c_se_m is not None
            row.append(measurement(1e3 * e.p_1c[k], 1e3 * e.p_1c_se_m[k]) if known else Num(NONE))
        rows.append(row)
    for k in range(3):
        row = [f"principal moment {k + 1}", "kg m²", value(float(truth.principal_moments[k]), 4)]
        for e in found:
            i = e.inertia
            row.append(
                measurement(i.principal.moments[k], i.principal.moments_se[k]) if i else Num(NONE)
            )
        rows.append(row)
    for j in (2, 3):
        distance = float(np.linalg.norm(truth.T(1, j)[:3, 3]))
        row = [symbols_entry(f"|p_1{j}|"), "mm", value(1e3 * distance, 5)]
        for e in found:
            pair = e.grasps.pair(1, j) if e.grasps is not None and e.robots >= j else None
            row.append(
                measurement(1e3 * float(np.linalg.norm(pair.p_ij)), 1e3 * pair.distance_se_m) if pair else Num(NONE)
            )
        rows.append(row)
    return table(f"Payload ({payload})", ["", "unit", "truth", *presets], rows)


def _trials(paper: Paper) -> Sequence[Node]:
    trials = paper.trials
    worst = {key: max(t[key] for t in trials) for key in trials[0] if key != "name"}
    head = ["trial", "rotation [deg]", "torque [N m]", "rod error [µm]", "weld error [µm]", "weld angle [µdeg]"]
    scales = (("rotation_deg", 1.0), ("torque_Nm", 1.0), ("rod_error_m", 1e6), ("weld_error_m", 1e6),
              ("weld_error_deg", 1e6))  # fmt: skip
    rows: list[list[Entry]] = [
        [t["name"], *(value(s * t[k], mark=t[k] == worst[k]) for k, s in scales)] for t in trials
    ]
    shown = tiles(
        [
            ("trials", str(len(trials)), ""),
            ("payload rotation", f"≤ {plain(worst['rotation_deg'])} deg", ""),
            ("spring torque", f"≤ {plain(worst['torque_Nm'])} N m", ""),
            ("rod error", f"≤ {plain(1e6 * worst['rod_error_m'], 2)} µm", f"limit {1e6 * ROD_LIMIT_M:g} µm"),
            ("grasp error", f"≤ {plain(1e6 * worst['weld_error_m'], 2)} µm", f"limit {1e6 * WELD_LIMIT_M:g} µm"),
        ]
    )
    listed = folded(
        f"Every trial ({len(trials)})",
        table("Extremes of every trial", head, rows, note="payload, kind, number, least ideal preset; largest in bold"),
    )
    return [shown, listed]
