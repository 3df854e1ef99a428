"""The part of the page on one estimate: payload and grasps with standard errors, and what the data say of them."""

import contextlib
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from estimator.errors import InputError
from estimator.estimate.frames import frames_said
from estimator.estimate.result import PayloadEstimate
from estimator.leftover.contradiction import CONTRADICTS
from mocobot_report.blocks.book import Book, section
from mocobot_report.blocks.html import Node
from mocobot_report.blocks.numbers import NONE, percent, plain, with_error
from mocobot_report.blocks.payload import distance, mass, moment, place
from mocobot_report.blocks.pictures import ASPECT
from mocobot_report.blocks.prose import bullets, folded, paragraph, tidy, tiles, verdict
from mocobot_report.blocks.tables import Entry, Num, component, measurement, quantity, table, value
from mocobot_report.estimate.charts import excitation_chart, grasp_charts, moment_chart
from mocobot_report.estimate.signals import signal_sections
from mocobot_report.estimate.truth import errors_table
from mocobot_report.folder import Estimated
from mocobot_report.sources import Source, sources
from mocobot_view.facts.body_facts import BodyFacts
from mocobot_view.facts.fact_files import read_truth
from mocobot_view.pictures.shots import estimate_shot

ORDER = ((0, 0, "xx"), (0, 1, "xy"), (0, 2, "xz"), (1, 1, "yy"), (1, 2, "yz"), (2, 2, "zz"))
DEG = 180.0 / np.pi


def title(estimated: Estimated) -> str:
    """What it is of."""
    label = estimated.estimate.payload
    return f"Payload ({label})" if label is not None else "Payload"


def answer(estimated: Estimated) -> list[Node]:
    """Mass, centre of mass, inertia and grasps, and whether to trust them."""
    e = estimated.estimate
    trials = [r.trial for r in e.recordings]
    kinds = ", ".join(f"{trials.count(kind)} {kind}" for kind in dict.fromkeys(trials))
    how = {
        "fit": "in one fit of closed loops and balance of wrenches",
        "staged": "in stages as in the paper",
        "joint": "by one joint least squares",
        "calibrated": "in one least squares with the robots' own calibration",
    }.get(e.method, e.method)
    if e.units is not None and e.method != "calibrated":
        how += ", on robots as a calibration has them"
    why = [paragraph(tidy(e.why_not_fit))] if e.why_not_fit else []
    said = (
        f"Estimated from {len(trials)} recording{'s' * (len(trials) != 1)} ({kinds}; "
        f"{sum(r.duration_s for r in e.recordings):.0f} s in all) of {e.robots} robot{'s' * (e.robots != 1)} that "
        f"hold{'s' * (e.robots == 1)} the payload together, {how}. Values are given with their standard errors"
        f"{f', in {tidy(frames_said(e.zero_sd_rad), inside=True)}' if e.zero_sd_rad else ''}."
    )
    return [paragraph(said, kind="lede"), tiles(_tiles(e)), *why, _doubts(e)]


def _tiles(e: PayloadEstimate) -> list[tuple[str, str, str]]:
    """Name, value and its error; what is not determined has neither."""
    found: dict[str, tuple[str, str]] = {}
    if e.mass:
        share = f"standard error {percent(e.mass.se / e.mass.mass)}" if e.mass.mass else ""
        found["mass"] = with_error(e.mass.mass, e.mass.se, "kg"), share
    if e.p_1c is not None and e.p_1c_se_m is not None:
        at = ", ".join(plain(1e3 * v, 4) for v in e.p_1c)
        found["centre of mass in {1}"] = (
            f"({at}) mm",
            f"± {plain(1e3 * float(np.max(e.p_1c_se_m)), 2)} mm at most",
        )
    if e.inertia is not None:
        principal = e.inertia.principal
        each = ", ".join(plain(float(v), 4) for v in principal.moments)
        most = plain(float(np.max(principal.moments_se)), 2)
        found["principal moments of inertia"] = f"{each} kg m²", f"± {most} kg m² at most"
    if e.grasps is not None and e.robots > 1:
        pairs = [e.grasps.pair(1, j) for j in range(2, e.robots + 1)]
        each = ", ".join(plain(1e3 * float(np.linalg.norm(p.p_ij)), 4) for p in pairs)
        most = plain(1e3 * max(p.distance_se_m for p in pairs), 2)
        found["distance of the grasps from the first"] = f"{each} mm", f"± {most} mm at most"
    names = ["mass", "centre of mass in {1}", "principal moments of inertia"]
    if e.robots > 1:
        names.append("grasps" if e.grasps is None else "distance of the grasps from the first")
    return [(name, *found.get(name, ("not determined", ""))) for name in names]


def _doubts(e: PayloadEstimate) -> Node:
    known = {"mass": e.mass, "centre of mass": e.p_1c, "inertia": e.inertia}
    known |= {"grasps": e.grasps} if e.robots > 1 else {}
    missing = [name for name, found in known.items() if found is None]
    left_open = [*(["Left open by the robots' calibration:", bullets(list(e.open))] if e.open else [])]
    if not e.undetermined and not e.flags and not missing:
        said = "The recordings determine every one of them and fit one rigid payload."
        return verdict("good", "Nothing speaks against these numbers", said, *left_open)
    return verdict(
        "bad" if e.contradicts else "warn",
        "The robots contradict each other: do not trust the standard errors"
        if e.contradicts
        else "What to know before these numbers are trusted",
        bullets(list(e.flags)) if e.flags else None,
        f"The recordings do not give: {', '.join(missing)}." if missing else None,
        *(
            ["Not determined by these recordings:", bullets(list(map(str, e.undetermined)))]
            if e.undetermined
            else []
        ),
        *left_open,
    )


def sections(book: Book, estimated: Estimated) -> list[Node]:
    """Everything below the answer."""
    e = estimated.estimate
    book.say(f"estimate {estimated.path.name}")
    found = sources(estimated.provenance, estimated.path.parent)
    truth, said = _truth(found, e)
    alone = any(r.inertia is not None for r in e.recordings)
    outline = [
        ("Payload", [_picture(book, found, e, truth), _payload(e)]),
        ("Grasps", [_grasps(e), grasp_charts(book, e)] if e.robots > 1 else None),
        ("Recording by recording", [moment_chart(book, e, truth) if alone else None, _recordings(e)]),
        ("Against the truth", [paragraph(said, kind="note"), errors_table(e, truth)] if truth else None),
        ("What the motion determines", _excitation(book, e)),
        ("What one rigid payload leaves over", signal_sections(book, found, e)),
    ]
    return [section(book, name, blocks) for name, blocks in outline if blocks is not None]


def _picture(book: Book, found: list[Source], e: PayloadEstimate, truth: BodyFacts | None) -> Node | None:
    """The team at one instant of the first recording that is still there."""
    for source in found:
        with contextlib.suppress(InputError):
            shot = partial(estimate_shot, source.recording(), e, truth, aspect=ASPECT)
            return book.gallery.ask([("The team as estimated", shot)])
    return None


def _truth(found: list[Source], e: PayloadEstimate) -> tuple[BodyFacts | None, str]:
    for source in found:
        if source.path is None:
            continue
        with contextlib.suppress(InputError):
            frames = ", in the frames that the encoders define" if e.zero_sd_rad else ""
            return read_truth(source.path, e.robots, e), (
                f"The truth is that beside {source.name}{frames}: these recordings are simulated. Error is estimate "
                "minus truth; errors beyond two or three standard errors come from what standard errors do not cover, "
                "such as calibration."
            )
    return None, ""


def _payload(e: PayloadEstimate) -> Node:
    rows: list[list[Entry]] = [["mass", "kg", mass(e)]]
    rows += [[quantity(f"p_1c {name}"), "mm", place(e, k)] for k, name in enumerate("xyz")]
    if e.inertia is None:
        rows.append(["inertia", "kg m²", Num(NONE)])
    else:
        se, p = np.sqrt(np.diag(e.inertia.covariance)), e.inertia.principal
        for k, (a, b, name) in enumerate(ORDER):
            rows.append([quantity(f"I_{name}"), "kg m²", measurement(float(e.inertia.inertia[a, b]), se[k])])
        rows += [[f"principal moment {k + 1}", "kg m²", moment(e, k)] for k in range(3)]
        for k, name in enumerate("xyz"):
            rows.append(
                [quantity(f"R_1c {name}"), "deg", component(p.axis_angle_rad, p.axis_angle_se_rad, k, DEG)]
            )
    note = "centre of mass in {1}; inertia about it, in the axes of {1}; R: rotation vector of the principal axes"
    return table("Mass, centre of mass and inertia", ["", "unit", "value ± standard error"], rows, note=note)


def _grasps(e: PayloadEstimate) -> list[Node]:
    if e.grasps is None:
        return [paragraph("The recordings do not determine the grasps.")]
    positions: list[list[Entry]] = []
    rotations: list[list[Entry]] = []
    for i, j in combinations(range(1, e.robots + 1), 2):
        pair = e.grasps.pair(i, j)
        places = [component(pair.p_ij, pair.p_se_m, k, 1e3) for k in range(3)]
        positions.append([quantity(f"p_{i}{j}"), *places, distance(e, i, j)])
        angles = [component(pair.axis_angle_rad, pair.axis_angle_se_rad, k, DEG) for k in range(3)]
        rotations.append([quantity(f"R_{i}{j}"), *angles])
    return [
        table("Grasp frames from each other: position", ["", "x [mm]", "y [mm]", "z [mm]", "distance [mm]"], positions,
              note="of frame {j} in frame {i}, ± standard error"),
        table("Grasp frames from each other: rotation", ["", "x [deg]", "y [deg]", "z [deg]"], rotations,
              note="rotation vector of frame {j} in frame {i}, ± standard error"),
    ]  # fmt: skip


def _recordings(e: PayloadEstimate) -> Node:
    head = [
        "recording",
        "trial",
        "length [s]",
        "holds",
        "force left over [% of weight]",
        "moment left over [mm]",
        "most left over [times noise]",
    ]
    rows = [
        [
            Path(r.name).name, r.trial, Num(f"{r.duration_s:.1f}"), Num(str(r.holds)),
            value(None if r.force_residual is None else 100.0 * r.force_residual, 2),
            value(None if r.moment_residual_m is None else 1e3 * r.moment_residual_m, 2),
            value(max((one.ratio for one in r.leftovers), default=None), 2),
        ]
        for r in e.recordings
    ]  # fmt: skip
    note = (
        "moment left over: the error of the centre of mass that would explain it; times noise: gaps at the flanges, "
        f"forces and moments that no rigid payload explains; beyond {CONTRADICTS:g} the robots contradict each other"
    )
    return table("Recordings", head, rows, note=note)


def _excitation(book: Book, e: PayloadEstimate) -> list[Node | None]:
    note = (
        "Every step solves for some parameters; a direction in which the motion's signal does not rise above the noise "
        "is not determined."
    )
    weak = [[quantity(w.step), w.direction, w.reason] for w in e.undetermined]
    head = ["step", "rank", "of", "condition", "weakest signal", "noise", "unit"]
    rows = [
        [
            quantity(s.step), Num(str(s.rank)), Num(str(len(s.singular_values))), value(s.condition, 3),
            value(s.singular_values[-1], 2), value(s.noise, 2), s.unit,
        ]
        for s in e.steps
    ]  # fmt: skip
    return [
        paragraph(note, kind="note"),
        excitation_chart(book, e),
        table("Directions that the data do not determine", ["step", "direction", "reason"], weak, stack=True)
        if weak
        else None,
        folded("As a table", table("Excitation of every step", head, rows)),
    ]
