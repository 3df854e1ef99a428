"""Show results as small HTML tables in notebooks, without scripts or network access; all text is escaped."""

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from discrepancy.result.read import name_of
from discrepancy.result.remains import remedy
from estimator.arm.unit import frames_said
from estimator.calibrate.calibration import Calibration
from estimator.estimate.result import PayloadEstimate
from mocobot_report.calibration import deviation_tables, payload_table, trial_table
from mocobot_report.numbers import percent, plain, tidy
from mocobot_report.tables import (
    Entry,
    Num,
    bullets,
    cause_name,
    chance_of,
    distance,
    mass,
    measurement,
    moment,
    numbers_of,
    place,
    quantity,
    sentence_of,
    table,
)

Values = Mapping[str, Any]
STYLE = (
    ".mocobot table{border-collapse:collapse;margin:.5em 0}.mocobot caption{text-align:left;font-weight:600}"
    ".mocobot caption .note{font-weight:400;opacity:.75;display:block}"
    ".mocobot th,.mocobot td{text-align:left;padding:.15em .8em .15em 0}.mocobot .num{text-align:right}"
)


def estimate_html(estimate: PayloadEstimate) -> str:
    """Tabulate mass, centre of mass, principal moments and grasps with standard errors, then list doubts."""
    e = estimate
    rows: list[list[Entry]] = [["mass", mass(e), "kg"]]
    rows += [[quantity(f"p_1c {axis}"), place(e, k), "mm"] for k, axis in enumerate("xyz")]
    rows += [[f"principal moment {k + 1}", moment(e, k), "kg m²"] for k in range(3)]
    rows += [[quantity(f"distance p_1{j}"), distance(e, 1, j), "mm"] for j in range(2, e.robots + 1)]
    title = f"Payload ({e.payload})" if e.payload is not None else "Payload"
    said = f"{len(e.recordings)} recording{'s' * (len(e.recordings) != 1)}, {e.method}; p in {{1}}"
    why = [e.why_not_fit] if e.why_not_fit else []
    why += [f"Values are in {frames_said(e.zero_sd_rad)}."] if e.zero_sd_rad else []
    doubts = [*why, *e.flags, *(f"Not determined: {weak}." for weak in e.undetermined)]
    return _whole(
        table(title, ["", "value ± standard error", "unit"], rows, note=said),
        bullets(doubts) if doubts else None,
    )


def calibration_html(calibration: Calibration) -> str:
    """Tabulate deviations with standard errors, payloads and recordings, then list findings and open questions."""
    said = [*calibration.findings, *(f"Open: {sentence}" for sentence in calibration.open)]
    return _whole(
        *deviation_tables(calibration),
        payload_table(calibration),
        trial_table(calibration),
        bullets(said) if said else None,
    )


def diagnosis_html(values: Values) -> str:
    """Show the verdict, the named causes with probabilities and parameters, and the misfit before and after."""
    rows: list[list[Entry]] = []
    for cause in values["causes"]:
        for k, (name, at, entry) in enumerate(numbers_of(cause) or [("", "", None)]):
            rows.append(
                [
                    cause_name(name_of(cause), cause["cause"]) if k == 0 else "",
                    Num(chance_of(cause["probability"])) if k == 0 else "",
                    f"{name}, {at}" if at else name,
                    measurement(entry["value"], entry["se"]) if entry else "",
                ]
            )
    residual = values["residual"]
    misfit: list[list[Entry]] = [["chi²/n as simulated", Num(plain(residual["nominal"]["chi2_per_n"]))]]
    if rows:
        misfit.append(["chi²/n with the named causes", Num(plain(residual["chi2_per_n"]))])
    removed = (values["gain"] or {}).get("removed")
    if removed is not None and rows:
        misfit.append(["excess error of the response removed", Num(percent(removed["share"]))])
    named = Markup("<p><strong>{}</strong></p>").format(values["verdict"].replace("_", " ").upper())
    sentences = [sentence_of(cause) for cause in values["causes"]]
    if values["verdict"] == "miscalibrated":
        sentences = [
            tidy(text) for text in (*(entry["sentence"] for entry in values["scatter"]), remedy(values))
        ]
    left = values["remains"]
    if not sentences and not left and values["verdict"] != "consistent":
        sentences = [tidy(residual["nominal"]["signature"]["sentence"])]
    sentences += map(tidy, left)
    head = ["cause", "probability [%]", "parameter", "value ± standard error"]
    return _whole(
        named,
        bullets(sentences) if sentences else None,
        table("Named causes", head, rows) if rows else None,
        table(
            "Misfit", ["", ""], misfit, note=f"of {len(values['recordings'])} trials; chi²/n of 1 is clean"
        ),
    )


def inspection_html(values: Values) -> str:
    """Show what the log can be used for, its faults, and a table of the robots' streams."""
    log, wrong = values["log"], [finding["sentence"] for finding in values["findings"]]
    rows: list[list[Entry]] = [
        [
            f"robot {robot}", Num(str(s["samples"])), Num(plain(s["rate_hz"], 6)), Num(f"{s['duration_s']:.1f}"),
            Num(str(s["gaps"])), Num(str(s["duplicates"])),
        ]
        for robot, s in enumerate(values["streams"], start=1)
    ]  # fmt: skip
    head = ["", "samples", "rate [Hz]", "length [s]", "gaps", "duplicates"]
    return _whole(
        Markup("<p><strong>{}</strong></p>").format(values["ready"]),
        bullets(wrong) if wrong else Markup("<p>Nothing wrong was found.</p>"),
        table(f"Log {log['name']}", head, rows, note=f"{log['level']} level"),
    )


def _whole(*blocks: Markup | None) -> str:
    inside = Markup("").join(block for block in blocks if block is not None)
    return str(Markup('<div class="mocobot"><style>{}</style>{}</div>').format(Markup(STYLE), inside))
