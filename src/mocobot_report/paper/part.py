"""The part of the page on the paper's experiment: the answer, Tables II-V beside ours, trials, payloads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocobot_report.blocks.blocks import (
    Entry,
    Num,
    bullets,
    component,
    folded,
    measurement,
    paragraph,
    quantity,
    section,
    table,
    tabs,
    tiles,
    value,
    verdict,
)
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.numbers import NONE, about, plain, spelled
from mocobot_report.blocks.pictures import ASPECT
from mocobot_report.folder import Paper
from mocobot_report.paper.charts import summary_chart, table_chart, trial_chart
from mocobot_sim.paper.published import payload_truth
from mocobot_sim.paper.tables import Cell, PaperTable, paper_tables, summary_table
from mocobot_sim.trial.rows import ROD_LIMIT_M, WELD_LIMIT_M, WELD_LIMIT_RAD
from mocobot_view.pictures.shots import team_shot

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
            f"Simulated teams of three mobile cobots carry payload{'s' * (len(payloads) > 1)} {names} and "
            "estimate grasps, mass, centre of mass and inertia from joint sensors alone. The errors "
            "stand beside those "
            "that Zhang, Liu, Elwin, Freeman and Lynch measured on hardware (IEEE RA-L 2025, Tables II-V).",
            kind="lede",
        )
    ]
    box = verdict("plain", "Our largest errors beside the paper's")
    box.append(bullets([item for name in presets if (item := _against(summary, name)) is not None]))
    out.append(box)
    return [*out, _trust(paper), _summary(summary)]


def _against(summary: PaperTable, preset: str) -> Node | None:
    """How many times smaller or larger the largest errors are than the published ones."""
    k = summary.columns.index(preset)
    pairs = [(row.cells[0].value, row.cells[k].value) for row in summary.rows]
    ratios = [published / ours for published, ours in pairs if published and ours]
    if not ratios:
        return None
    low, high = min(ratios), max(ratios)
    what = SENSORS.get(preset, "sensors of that name")
    if low >= 1.0:
        said = f"{about(low)} to {about(high)} times smaller than the paper's"
    elif high <= 1.0:
        said = f"{about(1 / high)} to {about(1 / low)} times the paper's"
    else:
        said = f"between {about(1 / high)} and {about(1 / low)} times the paper's"
    return el("span", el("b", preset), f" ({what}): {said}.")


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
        f"{plain(1e3 * weld, 2)} mm (limit {1e3 * limits[1]:g} mm) and {plain(angle, 2)} deg "
        f"(limit {limits[2]:g} deg).",
    )


def sections(book: Book, paper: Paper) -> list[Node]:
    """Everything below the answer."""
    book.say("paper's tables")
    summary = summary_table(paper.scores)
    two, three, four, five = paper_tables(paper.scores)
    whisker = "whisker: mean + standard deviation"
    blocks = [
        section(book, "Largest errors", summary_chart(book, summary), identity="largest"),
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
    for name, title in kinds:
        rows = tuple(row for row in four.part("%").rows if row.quantity == name)
        part = PaperTable(four.number, four.title, four.note, four.columns, rows)
        charts.append(table_chart(book, part, title, "one set of six static holds"))
    return [el("div", *charts, class_="pair")]


def _table(shown: PaperTable) -> Node:
    rows: list[list[Entry]] = []
    last = ""
    for row in shown.rows:
        head = f"({row.payload})" if row.payload != last else ""
        rows.append([head, quantity(row.quantity), spelled(row.unit), *map(_cell, row.cells)])
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


def _estimates(book: Book, paper: Paper) -> list[Node]:
    payloads = list(dict.fromkeys(payload for payload, _ in paper.estimates))
    panels = [(f"payload ({payload})", _against_truth(paper, payload)) for payload in payloads]
    note = paragraph(
        "Value ± standard error; the truth is Table I of the paper. Standard errors cover noise "
        "and quantisation, not "
        "calibration: on uncalibrated robots they are far too small.",
        kind="note",
    )
    return [note, *tabs(book, "Payload", panels)]


def _against_truth(paper: Paper, payload: str) -> Node:
    truth = payload_truth(payload)
    presets = [preset for p, preset in paper.estimates if p == payload]
    found = [paper.estimates[payload, preset] for preset in presets]
    masses = [measurement(e.mass.mass, e.mass.se) if e.mass else Num(NONE) for e in found]
    rows: list[list[Entry]] = [["mass", "kg", value(truth.mass, 5), *masses]]
    for k, name in enumerate("xyz"):
        places = [component(e.p_1c, e.p_1c_se_m, k, 1e3) for e in found]
        rows.append([quantity(f"p_1c {name}"), "mm", value(1e3 * float(truth.p_1c[k]), 4), *places])
    for k in range(3):
        principal = [None if e.inertia is None else e.inertia.principal for e in found]
        moments = [component(p.moments, p.moments_se, k) if p else Num(NONE) for p in principal]
        true = value(float(truth.principal_moments[k]), 4)
        rows.append([f"principal moment {k + 1}", "kg m²", true, *moments])
    for j in (2, 3):
        true = value(1e3 * float(np.linalg.norm(truth.T(1, j)[:3, 3])), 5)
        pairs = [e.grasps.pair(1, j) if e.grasps is not None and e.robots >= j else None for e in found]
        lengths = [
            measurement(1e3 * float(np.linalg.norm(pair.p_ij)), 1e3 * pair.distance_se_m)
            if pair
            else Num(NONE)
            for pair in pairs
        ]
        rows.append([quantity(f"|p_1{j}|"), "mm", true, *lengths])
    return table(f"Payload ({payload})", ["", "unit", "truth", *presets], rows)


def _trials(paper: Paper) -> Sequence[Node]:
    trials = paper.trials
    worst = {key: max(t[key] for t in trials) for key in trials[0] if key != "name"}
    head = [
        "trial",
        "rotation [deg]",
        "torque [N m]",
        "rod error [µm]",
        "weld error [µm]",
        "weld angle [µdeg]",
    ]
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
            (
                "grasp error",
                f"≤ {plain(1e6 * worst['weld_error_m'], 2)} µm",
                f"limit {1e6 * WELD_LIMIT_M:g} µm",
            ),
        ]
    )
    listed = folded(
        f"Every trial ({len(trials)})",
        table(
            "Extremes of every trial",
            head,
            rows,
            note="payload, kind, number, least ideal preset; largest in bold",
        ),
    )
    return [shown, listed]
