"""Report of the paper's experiment: largest errors, Tables II-V beside ours, trials, estimates against the truth."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import cycle, groupby
from typing import Any

import numpy as np

from estimator.estimate.result import PayloadEstimate
from mocobot_report.charts import Chart, Key, Trace, column_axis, dots, log_axis, row_layout
from mocobot_report.folder import Paper, Result
from mocobot_report.numbers import PLUS_MINUS, about, plain, spelled, spelled_text
from mocobot_report.tables import Entry, Num, distance, mass, moment, place, quantity, value
from mocobot_sim.paper.experiment import ONE_FIT, SCATTERED, SELF_CALIBRATED, TRANSFER
from mocobot_sim.paper.scoring import SPRING_SCALE, payload_truth
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
from mocobot_sim.trial.trial_log import ROD_LIMIT_M, WELD_LIMIT_M, WELD_LIMIT_RAD
from mocobot_view.pictures import team_shot

COLUMNS = {
    "paper": ("paper", "diamond"), "ideal": ("ideal", "triangle-down"), "nominal": ("nominal", "circle"),
    "uncalibrated": ("uncalibrated", "square"), ONE_FIT: ("nominal", "circle-open"),
    SCATTERED: ("c2", "x"), SELF_CALIBRATED: ("c1", "triangle-up"), TRANSFER: ("c1", "triangle-up-open"),
}  # fmt: skip
"""Colour and marker of each column of the tables: the paper, presets and fits."""
OTHER_COLOURS, OTHER_MARKERS = ("c1", "c2"), ("triangle-up", "circle-open", "x")
SENSORS = {
    "ideal": "exact sensors",
    "nominal": "16-bit encoders and noisy torques in steps of 0.01 N m",
    "uncalibrated": "the same on robots with calibration errors of about 1 deg, 2 % of spring stiffness and 1 mm",
    SCATTERED: "the uncalibrated team with encoder zeros that differ from trial to trial",
    ONE_FIT: "the nominal team, estimated by one fit of three trials in place of the paper's stages",
    SELF_CALIBRATED: "the uncalibrated team, calibrated on three of its own recordings and nothing else",
    TRANSFER: "the uncalibrated team as one payload has calibrated it, carrying the others",
}
LEAST = 1e-7
"""Smallest drawn error [unit of the axis]; smaller ones are drawn there, as a logarithmic axis has no zero. Chosen."""
NARROW = {"margin.l": 46, "xaxis.tickfont.size": 9}
MICRO = 1e6
EXTREMES = {
    "rotation [deg]": ("rotation_deg", 1.0), "torque [N m]": ("torque_Nm", 1.0),
    "rod error [µm]": ("rod_error_m", MICRO), "weld error [µm]": ("weld_error_m", MICRO),
    "weld angle [µdeg]": ("weld_error_deg", MICRO),
}  # fmt: skip
"""Columns of the table of trials, with key and scale of each."""


def context(result: Result, say: Callable[[str], object]) -> dict[str, Any]:
    """Return the data of ``assets/paper.html``."""
    say("paper's tables")
    paper: Paper = result.found
    summary, payloads = summary_table(paper.scores), list(next(iter(paper.scores.values())))
    presets = [name for name in summary.columns if name != "paper"]
    against = [(name, _beyond_calibration(paper, name), _ratio(summary, name)) for name in presets]
    estimated = dict.fromkeys(payload for payload, _ in paper.estimates)
    return {
        "title": "The paper's experiment, simulated",
        "payloads": payloads,
        "against": [
            {"name": name, "sensors": SENSORS.get(name), "calibrated": calibrated, "ratio": ratio}
            for name, calibrated, ratio in against
            if calibrated or ratio
        ],
        "trust": _trust(paper.trials),
        "summary": summary,
        "summary_rows": [[_named(row), spelled(row.unit), *map(_cell, row.cells)] for row in summary.rows],
        "summary_chart": _summary_chart(summary),
        **_tables(paper),
        "trial_chart": _trial_chart(paper.estimates),
        "estimates": [(f"Payload ({name})", *_against_truth(paper, name)) for name in estimated],
        "trials": _trials(paper.trials),
        "extremes": list(EXTREMES),
        "pictures": [(f"Payload ({name})", partial(team_shot, name)) for name in payloads],
    }


def _ratio(summary: PaperTable, preset: str) -> str | None:
    """State by which factors the largest errors are smaller or larger than the published ones."""
    k = summary.columns.index(preset)
    pairs = [(row.cells[0].value, row.cells[k].value) for row in summary.rows]
    ratios = [published / ours for published, ours in pairs if published and ours]
    if not ratios:
        return None
    low, high = min(ratios), max(ratios)
    if low >= 1.0:
        return f"{about(low)} to {about(high)} times smaller than the paper's"
    if high <= 1.0:
        return f"{about(1 / high)} to {about(1 / low)} times the paper's"
    return f"between {about(1 / high)} and {about(1 / low)} times the paper's"


def _beyond_calibration(paper: Paper, column: str) -> dict[str, str] | None:
    """Return the largest errors of a calibrated team in the frames of the encoders; None for other columns."""
    entries = [entry for entry in paper.scores[column].values() if entry is not None]
    shares = [entry[SPRING_SCALE] for entry in entries if SPRING_SCALE in entry]
    table = summary_table(paper.scores)
    if not any(share["percent"] for share in shares) or not table.part("deg", frames=BY_ENCODERS).rows:
        return None
    at = table.columns.index(column)

    def largest(name: str, unit: str, frames: str = BY_ENCODERS) -> str:
        return f"{plain(table.part(unit, name, frames).rows[0].cells[at].value, 2)} {unit}"

    beyond = max(share[f"{name}_percent"] for share in shares for name in ("m", *MOMENTS))
    return {
        "rotation": largest("grasp rotation", "deg"),
        "position": largest("grasp position", "mm"),
        "centre": largest("centre of mass", "mm"),
        "beyond": plain(beyond, 2),
        "scale": plain(max(abs(share["percent"]) for share in shares), 2),
        "by_cad": largest("grasp rotation", "deg", ""),
    }


def _trust(trials: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """Check the constraint errors of the simulation in all trials; None without data."""
    if not trials:
        return None
    worst = {key: max(t[key] for t in trials) for key in ("rod_error_m", "weld_error_m", "weld_error_deg")}
    rod, weld, angle = worst.values()
    most_deg = float(np.rad2deg(WELD_LIMIT_RAD))
    return {
        "good": rod <= ROD_LIMIT_M and weld <= WELD_LIMIT_M and angle <= most_deg,
        "count": len(trials),
        "rod": f"{plain(1e3 * rod, 2)} mm (limit {1e3 * ROD_LIMIT_M:g} mm)",
        "weld": f"{plain(1e3 * weld, 2)} mm (limit {1e3 * WELD_LIMIT_M:g} mm)",
        "angle": f"{plain(angle, 2)} deg (limit {most_deg:g} deg)",
    }


def _tables(paper: Paper) -> dict[str, Any]:
    """Make Tables II-V and their charts."""
    two, three, four, five = paper_tables(paper.scores)
    above, one_set = "whisker: mean + standard deviation", "one set of six static holds"
    frames = "each grasp frame turned by the zero of its last gimbal axis, which nothing measured can tell"
    share = spring_share(paper.scores)
    scale = f"; {plain(share, 2)} % of it in calibrated teams: the springs' common scale" if share else ""
    whisker = "whisker: plus the standard deviation of the estimates"

    def charts(*wanted: tuple[PaperTable, str, str]) -> list[Chart]:
        return [_table_chart(rows, title, note) for rows, title, note in wanted if rows.rows]

    return {
        "tables": [_table(one) for one in (two, three, four, five)],
        "rotations": charts(
            (two.part("deg"), "Table II: rotation error [deg]", above),
            (two.part("deg", frames=BY_ENCODERS), "Table II: rotation error, encoder frames [deg]", frames),
        ),
        "positions": charts(
            (three.part("%"), "Table III: position error [% of |p|]", above),
            (three.part("%", frames=BY_ENCODERS), "Table III: position error, encoder frames [% of |p|]", frames),
        ),
        "holds": charts(
            (four.part("%", "m"), "Table IV: mass error [%]", one_set + scale),
            (four.part("%", "p1c"), "Table IV: centre-of-mass error [% of |p1c|]", one_set),
            (four.part("%", "p1c", BY_ENCODERS), "Table IV: centre-of-mass error, encoder frames [% of |p1c|]", frames),
        ),
        "inertia": charts((five.part("%"), "Table V: |mean error| of the principal moments [%]", whisker + scale)),
    }  # fmt: skip


def _table(shown: PaperTable) -> dict[str, Any]:
    rows: list[list[Entry]] = []
    last = ""
    for row in shown.rows:
        head = f"({row.payload})" if row.payload != last else ""
        rows.append([head, _named(row), spelled(row.unit), *map(_cell, row.cells)])
        last = row.payload
    return {
        "caption": f"Table {shown.number}. {shown.title}".replace("[kg m^2]", "[kg m²]"),
        "head": ["payload", "", "unit", *shown.columns],
        "rows": rows,
        "note": shown.note.replace("+-", PLUS_MINUS),
    }


def _named(row: Row) -> str:
    return quantity(f"{row.quantity}, {row.frames}" if row.frames else row.quantity)


def _cell(cell: Cell) -> Num:
    return Num(plain(cell.value, 2), "" if cell.spread is None else plain(cell.spread, 2))


def _keys(columns: Sequence[str]) -> list[Key]:
    """Make the legend of the columns; unknown presets get the remaining colours and markers."""
    left = zip(cycle(OTHER_COLOURS), cycle(OTHER_MARKERS))
    return [Key(name, name, *(COLUMNS[name] if name in COLUMNS else next(left))) for name in columns]


def _table_chart(table: PaperTable, title: str, note: str) -> Chart:
    """Plot one column per row of a table with one unit, and one dot per preset; whiskers show the spread upward."""
    legend, rows, unit = _keys(table.columns), table.rows, spelled_text(f"[{table.rows[0].unit}]")
    data, seen = [], []
    for k, key in enumerate(legend):
        cells = [row.cells[k] for row in rows]
        values, spreads = [_drawn(c.value) for c in cells], [c.spread or 0.0 for c in cells]
        for v, spread in zip(values, spreads, strict=True):
            seen += [] if v is None else [v, v + spread]
        text = [
            f"{key.label}, payload ({row.payload}), {row.quantity}: {plain(c.value)}"
            + ("" if c.spread is None else f" {PLUS_MINUS} {plain(c.spread, 2)}")
            + f" {unit}"
            for row, c in zip(rows, cells, strict=True)
        ]
        # On a logarithmic axis, a downward whisker has no meaning.
        up = {"array": spreads, "arrayminus": [0.0] * len(rows), "thickness": 1.3, "width": 3}
        aside = _aside(k, legend, min(0.16, 0.85 / len(legend)))
        data.append(dots([n + aside for n in range(len(rows))], values, key, text))
        if any(spreads):
            data[-1]["error_y"] = up
    layout = _by_payload([(row.payload, row.quantity) for row in rows], f"error {unit}", seen)
    label = f"{title}. The numbers are in Table {table.number} below."
    return Chart(title, label, data, layout, 330, legend, note, NARROW)


def _summary_chart(table: PaperTable) -> Chart:
    """Plot the largest errors in percent or degrees, one row per quantity."""
    rows = [row for row in table.rows if row.unit in ("%", "deg")]
    names = [f"{row.quantity} [{row.unit}]" + (f", {row.frames}" if row.frames else "") for row in rows]
    wide = any(row.frames for row in rows)
    legend, data, seen = _keys(table.columns), [], []
    for k, key in enumerate(legend):
        values = [row.cells[k].value for row in rows]
        text = [f"{key.label}, {name}: {plain(v)}" for name, v in zip(names, values, strict=True)]
        data.append(dots([*map(_drawn, values)], range(len(rows)), key, text, size=11))
        seen += map(_drawn, values)
    left_px, font_px = (245, 8) if wide else (150, 10)
    across = log_axis("largest error", seen)
    return Chart(
        "Largest errors at a glance",
        "Largest error of every quantity, the paper's beside ours; the numbers are in the first table.",
        data, keys=legend, **row_layout(names, across, row_px=30, left_px=left_px, most=40, font_px=font_px),
    )  # fmt: skip


def _trial_chart(estimates: Mapping[tuple[str, str], PayloadEstimate]) -> Chart | None:
    """Plot the errors of the principal moments from every single recording."""
    payloads = list(dict.fromkeys(payload for payload, _ in estimates))
    legend, seen = _keys(list(dict.fromkeys(preset for _, preset in estimates))), []
    data: list[Trace] = []
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
        data.append(dots(x, y, key, text, size=7, opacity=0.8))
    if not seen:
        return None
    columns = [(payload, name) for payload in payloads for name in MOMENTS]
    return Chart(
        "Principal moments from every trial on its own",
        "Relative error of the principal moments of inertia that each recording alone gives.",
        data, _by_payload(columns, "|error| [%]", seen), 330, legend,
        "one dot per recording with motion; Table V averages them with their signs", NARROW,
    )  # fmt: skip


def _drawn(value: float | None) -> float | None:
    return None if value is None else max(value, LEAST)


def _aside(k: int, legend: Sequence[Key], apart: float) -> float:
    """Return the offset of the dots of legend entry k from the middle of their column."""
    return apart * (k - (len(legend) - 1) / 2)


def _by_payload(
    columns: Sequence[tuple[str, str]], title: str, seen: Iterable[float | None]
) -> dict[str, Any]:
    """Make the axes for columns (payload, quantity): each payload named once, every second one shaded."""
    names, shaded = [], []
    for k, (payload, group) in enumerate(groupby(columns, key=lambda column: column[0])):
        each, start = list(group), len(names)
        for n, (_, what) in enumerate(each):
            head = f"<b>({payload})</b>" if n == len(each) // 2 else "<b></b>"
            names.append(f"{what}<br>{head}" if len(each) > 1 else head)
        if k % 2:
            shaded.append({
                "type": "rect", "x0": start - 0.5, "x1": len(names) - 0.5, "y0": 0, "y1": 1, "yref": "y domain",
                "layer": "below", "line": {"width": 0}, "opacity": 0.5,
            })  # fmt: skip
    return {"xaxis": column_axis(names), "yaxis": log_axis(title, seen), "shapes": shaded}


def _against_truth(paper: Paper, payload: str) -> tuple[list[str], list[list[Entry]]]:
    """Return the presets, and rows of truth and estimates for one payload."""
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
    return list(found), rows


def _trials(trials: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """Make tiles with the largest values, and one row per trial."""
    if not trials:
        return None
    worst = {key: max(t[key] for t in trials) for key, _ in EXTREMES.values()}
    rod, weld = (f"≤ {plain(MICRO * worst[key], 2)} µm" for key in ("rod_error_m", "weld_error_m"))
    tiles = [
        ("trials", str(len(trials)), ""),
        ("payload rotation", f"≤ {plain(worst['rotation_deg'])} deg", ""),
        ("spring torque", f"≤ {plain(worst['torque_Nm'])} N m", ""),
        ("rod error", rod, f"limit {MICRO * ROD_LIMIT_M:g} µm"),
        ("grasp error", weld, f"limit {MICRO * WELD_LIMIT_M:g} µm"),
    ]
    cells = EXTREMES.values()
    rows = [[t["name"], *(value(scale * t[k], mark=t[k] == worst[k]) for k, scale in cells)] for t in trials]
    return {"tiles": tiles, "rows": rows}
