"""The part of the page on one estimate: payload and grasps with standard errors, and what the data say of them."""

from __future__ import annotations

from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
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
    tiles,
    value,
    verdict,
)
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.numbers import NONE, percent, plain, with_error
from mocobot_report.blocks.pictures import ASPECT
from mocobot_report.estimate.charts import excitation_chart, grasp_charts, moment_chart
from mocobot_report.estimate.signals import signal_sections
from mocobot_report.estimate.truth import errors_table
from mocobot_report.folder import Estimated
from mocobot_report.sources import Source, sources
from mocobot_view.facts.body_facts import BodyFacts
from mocobot_view.facts.fact_files import read_truth
from mocobot_view.pictures.shots import estimate_shot

ORDER = ((0, 0, "xx"), (0, 1, "xy"), (0, 2, "xz"), (1, 1, "yy"), (1, 2, "yz"), (2, 2, "zz"))


def title(estimated: Estimated) -> str:
    """What it is of."""
    label = estimated.estimate.payload
    return f"Payload ({label})" if label is not None else "Payload"


def answer(estimated: Estimated) -> list[Node]:
    """Mass, centre of mass, inertia and grasps, and whether to trust them."""
    e = estimated.estimate
    kinds = [
        f"{sum(r.trial == kind for r in e.recordings)} {kind}"
        for kind in dict.fromkeys(r.trial for r in e.recordings)
    ]
    seconds = sum(r.duration_s for r in e.recordings)
    said = (
        f"Estimated from {len(e.recordings)} recording{'s' * (len(e.recordings) != 1)} "
        f"({', '.join(kinds)}; {seconds:.0f} s "
        f"in all) of {e.robots} robot{'s' * (e.robots != 1)} that hold{'s' * (e.robots == 1)} the "
        "payload together, "
        f"{'in stages as in the paper' if e.method == 'staged' else 'by one joint least squares'}. "
        "Values are given "
        "with their standard errors."
    )
    return [paragraph(said, kind="lede"), tiles(_tiles(e)), _doubts(e)]


def _tiles(e: PayloadEstimate) -> list[tuple[str, str, str]]:
    none = "not determined"
    mass = with_error(e.mass.mass, e.mass.se, "kg") if e.mass else none
    share = percent(e.mass.se / e.mass.mass) if e.mass and e.mass.mass else ""
    out = [("mass", mass, f"standard error {share}" if share else "")]
    if e.p_1c is not None and e.p_1c_se_m is not None:
        at = ", ".join(plain(1e3 * v, 4) for v in e.p_1c)
        out.append(
            (
                "centre of mass in {1}",
                f"({at}) mm",
                f"± {plain(1e3 * float(np.max(e.p_1c_se_m)), 2)} mm at most",
            )
        )
    else:
        out.append(("centre of mass in {1}", none, ""))
    if e.inertia is not None:
        moments, se = e.inertia.principal.moments, e.inertia.principal.moments_se
        each = ", ".join(plain(float(v), 4) for v in moments)
        out.append(
            (
                "principal moments of inertia",
                f"{each} kg m²",
                f"± {plain(float(np.max(se)), 2)} kg m² at most",
            )
        )
    else:
        out.append(("principal moments of inertia", none, ""))
    if e.robots > 1:
        if e.grasps is None:
            out.append(("grasps", none, ""))
        else:
            pairs = [e.grasps.pair(1, j) for j in range(2, e.robots + 1)]
            each = ", ".join(plain(1e3 * float(np.linalg.norm(p.p_ij)), 4) for p in pairs)
            worst = 1e3 * max(p.distance_se_m for p in pairs)
            out.append(
                ("distance of the grasps from the first", f"{each} mm", f"± {plain(worst, 2)} mm at most")
            )
    return out


def _doubts(e: PayloadEstimate) -> Node:
    weak = [str(direction) for direction in e.undetermined]
    known = {"mass": e.mass, "centre of mass": e.p_1c, "inertia": e.inertia}
    known |= {"grasps": e.grasps} if e.robots > 1 else {}
    missing = [name for name, found in known.items() if found is None]
    if not weak and not e.flags and not missing:
        return verdict("good", "Nothing speaks against these numbers",
                       "The recordings determine every one of them and fit one rigid payload.")  # fmt: skip
    box = verdict("warn", "What to know before these numbers are trusted")
    if e.flags:
        box.append(bullets(list(e.flags)))
    if missing:
        box.append(el("p", f"The recordings do not give: {', '.join(missing)}."))
    if weak:
        box.append(el("p", "Not determined by these recordings:"))
        box.append(bullets(weak))
    return box


def sections(book: Book, estimated: Estimated) -> list[Node]:
    """Everything below the answer."""
    e, folder = estimated.estimate, estimated.path.parent
    book.say(f"estimate {estimated.path.name}")
    found = sources(estimated.provenance, folder)
    truth, said = _truth(found, e.robots)
    blocks = [section(book, "Payload", *_picture(book, found, e, truth), _payload(e))]
    if e.robots > 1:
        blocks.append(section(book, "Grasps", _grasps(e), grasp_charts(book, e)))
    if any(r.inertia is not None for r in e.recordings):
        blocks.append(section(book, "Recording by recording", moment_chart(book, e, truth), _recordings(e)))
    else:
        blocks.append(section(book, "Recording by recording", _recordings(e)))
    if truth is not None:
        blocks.append(
            section(book, "Against the truth", paragraph(said, kind="note"), errors_table(e, truth))
        )
    blocks.append(section(book, "What the motion determines", *_excitation(book, e)))
    blocks.append(section(book, "What one rigid payload leaves over", *signal_sections(book, found, e)))
    return blocks


def _picture(book: Book, found: list[Source], e: PayloadEstimate, truth: BodyFacts | None) -> list[Node]:
    """The team at one instant of the first recording that is still there."""
    for source in found:
        recording = source.read()
        if not isinstance(recording, str):
            shot = [("The team as estimated", partial(estimate_shot, recording, e, truth, aspect=ASPECT))]
            return [book.gallery.ask(shot)]
    return []


def _truth(found: list[Source], robots: int) -> tuple[BodyFacts | None, str]:
    for source in found:
        if source.path is None:
            continue
        try:
            truth = read_truth(source.path, robots)
        except InputError:
            continue
        return truth, (
            f"The truth is that beside {source.name}: these recordings are simulated. Error is estimate "
            "minus truth; "
            "errors beyond two or three standard errors come from what standard errors do not cover, "
            "such as calibration."
        )
    return None, ""


def _payload(e: PayloadEstimate) -> Node:
    mass = measurement(e.mass.mass, e.mass.se) if e.mass else Num(NONE)
    rows: list[list[Entry]] = [["mass", "kg", mass]]
    for k, name in enumerate("xyz"):
        rows.append([quantity(f"p_1c {name}"), "mm", component(e.p_1c, e.p_1c_se_m, k, 1e3)])
    if e.inertia is None:
        rows.append(["inertia", "kg m²", Num(NONE)])
    else:
        se = np.sqrt(np.diag(e.inertia.covariance))
        for k, (a, b, name) in enumerate(ORDER):
            rows.append([quantity(f"I_{name}"), "kg m²", measurement(float(e.inertia.inertia[a, b]), se[k])])
        principal = e.inertia.principal
        for k in range(3):
            moment = component(principal.moments, principal.moments_se, k)
            rows.append([f"principal moment {k + 1}", "kg m²", moment])
        for k, name in enumerate("xyz"):
            angle = component(principal.axis_angle_rad, principal.axis_angle_se_rad, k, 180.0 / np.pi)
            rows.append([quantity(f"R_1c {name}"), "deg", angle])
    return table(
        "Mass, centre of mass and inertia", ["", "unit", "value ± standard error"], rows,
        note="centre of mass in {1}; inertia about it, in the axes of {1}; R: rotation vector of the principal axes",
    )  # fmt: skip


def _grasps(e: PayloadEstimate) -> Node:
    if e.grasps is None:
        return paragraph("The recordings do not determine the grasps.")
    positions: list[list[Entry]] = []
    rotations: list[list[Entry]] = []
    for i, j in combinations(range(1, e.robots + 1), 2):
        pair = e.grasps.pair(i, j)
        places = [component(pair.p_ij, pair.p_se_m, k, 1e3) for k in range(3)]
        distance = measurement(1e3 * float(np.linalg.norm(pair.p_ij)), 1e3 * pair.distance_se_m)
        positions.append([quantity(f"p_{i}{j}"), *places, distance])
        angles = [component(pair.axis_angle_rad, pair.axis_angle_se_rad, k, 180.0 / np.pi) for k in range(3)]
        rotations.append([quantity(f"R_{i}{j}"), *angles])
    return el(
        "div",
        table("Grasp frames from each other: position", ["", "x [mm]", "y [mm]", "z [mm]", "distance [mm]"], positions,
              note="of frame {j} in frame {i}, ± standard error"),
        table("Grasp frames from each other: rotation", ["", "x [deg]", "y [deg]", "z [deg]"], rotations,
              note="rotation vector of frame {j} in frame {i}, ± standard error"),
    )  # fmt: skip


def _recordings(e: PayloadEstimate) -> Node:
    head = [
        "recording",
        "trial",
        "length [s]",
        "holds",
        "force left over [% of weight]",
        "moment left over [mm]",
    ]
    rows: list[list[Entry]] = [
        [
            Path(r.name).name, r.trial, Num(f"{r.duration_s:.1f}"), Num(str(r.holds)),
            value(None if r.force_residual is None else 100.0 * r.force_residual, 2),
            value(None if r.moment_residual_m is None else 1e3 * r.moment_residual_m, 2),
        ]
        for r in e.recordings
    ]  # fmt: skip
    return table(
        "Recordings",
        head,
        rows,
        note="moment left over: the error of the centre of mass that would explain it",
    )


def _excitation(book: Book, e: PayloadEstimate) -> list[Node]:
    head = ["step", "rank", "of", "condition", "weakest signal", "noise", "unit"]
    rows: list[list[Entry]] = [
        [
            quantity(s.step), Num(str(s.rank)), Num(str(len(s.singular_values))), value(s.condition, 3),
            value(s.singular_values[-1], 2), value(s.noise, 2), s.unit,
        ]
        for s in e.steps
    ]  # fmt: skip
    weak: list[Node] = []
    if e.undetermined:
        listed: list[list[Entry]] = [[quantity(w.step), w.direction, w.reason] for w in e.undetermined]
        weak = [table("Directions that the data do not determine", ["step", "direction", "reason"], listed)]
    shown = excitation_chart(book, e)
    note = paragraph(
        "Every step solves for some parameters; a direction in which the motion's signal does not "
        "rise above the noise is "
        "not determined.",
        kind="note",
    )
    return [note, shown, *weak, folded("As a table", table("Excitation of every step", head, rows))]
