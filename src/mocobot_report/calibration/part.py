"""The part of the page on one calibration: whether to trust it, the robots as they are, what stays open."""

from __future__ import annotations

import numpy as np

from estimator.calibrate.calibration import Calibration, carried
from estimator.calibrate.text import frames_sentence
from mocobot_report.blocks.book import Book, section, tabs
from mocobot_report.blocks.html import Node
from mocobot_report.blocks.numbers import NONE, plain, with_error
from mocobot_report.blocks.prose import bullets, paragraph, tidy, tiles, verdict
from mocobot_report.calibration.charts import certainty_chart, deviation_chart, fit_charts, share_chart
from mocobot_report.calibration.tables import deviation_tables, payload_table, trial_table
from mocobot_report.folder import Calibrated


def title(calibrated: Calibrated) -> str:
    """What it is of."""
    return f"Calibration of {calibrated.calibration.robots} robots"


def answer(calibrated: Calibrated) -> list[Node]:
    """What was calibrated from what, the payloads, whether to trust it, and what stays open."""
    c = calibrated.calibration
    kinds = [trial.kind for trial in c.trials]
    listed = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    said = (
        f"Every robot as it is, from {len(kinds)} recording{'s' * (len(kinds) != 1)} ({listed}; "
        f"{sum(trial.duration_s for trial in c.trials):.0f} s in all) of what the team carries: its loops must close, "
        f"and its wrenches must move the payload. Results are in {frames_sentence(c)}."
    )
    out = [paragraph(said, kind="lede"), tiles(_tiles(c)), _doubts(c)]
    if c.open:
        out.append(verdict("plain", "What stays open", bullets([tidy(said) for said in c.open])))
    return out


def _tiles(c: Calibration) -> list[tuple[str, str, str]]:
    out = []
    for payload in c.payloads:
        found = carried(payload, c.scale_sd)
        label = "" if payload.label is None else f" of payload ({payload.label})"
        out.append((f"mass{label}", with_error(found.mass_kg, found.mass_se_kg, "kg"), ""))
    for name, key in (("as designed", "before"), ("calibrated", "after"), ("left out", "held_out")):
        pairs = [getattr(t, key) for t in c.trials if t.payload is not None and getattr(t, key) is not None]
        value = (
            " / ".join(plain(float(np.mean([p[k] for p in pairs])), 3) for k in range(2)) if pairs else NONE
        )
        out.append((f"chi²/n {name}", value, "loops / balance, mean of recordings"))
    return out


def _doubts(c: Calibration) -> Node:
    if not c.findings:
        said = "Loops and balance fit to within noise, and nothing in the recordings contradicts the calibration."
        return verdict("good", "Nothing speaks against these numbers", said)
    return verdict("bad", "What speaks against these numbers", bullets([tidy(said) for said in c.findings]))


def sections(book: Book, calibrated: Calibrated) -> list[Node]:
    """Everything below the answer."""
    c = calibrated.calibration
    book.say("calibration")
    untouched = ", ".join(c.untouched)
    robots = [(f"Robot {k + 1}", one) for k, one in enumerate(deviation_tables(c))]
    outline = [
        (
            "The robots as they are",
            [
                deviation_chart(book, c),
                certainty_chart(book, c),
                paragraph(f"Hardly touched by these recordings: {untouched}.") if untouched else None,
                tabs(book, "Robot", robots),
            ],
        ),
        ("What was carried", [payload_table(c), _scale(c)]),
        (
            "Before, after, and left out",
            [
                paragraph(
                    "Loops: where the robots have each other's grasps. Balance: their forces and moments minus what "
                    "the payload's motion needs. A recording that is left out is foretold by a calibration from all "
                    "others; only where the bases stood is fitted to it.", kind="note",
                ),
                fit_charts(book, c), trial_table(c),
            ],
        ),
        ("What each recording contributes", [share_chart(book, c)]),
    ]  # fmt: skip
    return [section(book, name, [block for block in blocks if block is not None]) for name, blocks in outline]


def _scale(c: Calibration) -> Node | None:
    if c.scale_sd == 0:
        return None
    share = plain(100.0 * c.scale_sd, 2)
    return paragraph(
        f"The common scale of all springs is held as designed: nothing but a known weight decides it. Its uncertainty, "
        f"{share} %, is in the errors of mass and inertia.", kind="note",
    )  # fmt: skip
