"""The part of the page on a diagnosis: verdict, causes, gain, and what the residual says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.result import PayloadEstimate
from mocobot_report.blocks.blocks import (
    Entry,
    Num,
    bullets,
    facts,
    folded,
    measurement,
    paragraph,
    section,
    table,
    tidy,
    tiles,
    value,
    verdict,
)
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.numbers import NONE, fitting, percent, plain, power
from mocobot_report.blocks.pictures import ASPECT
from mocobot_report.blocks.units import parameter, short_names
from mocobot_report.diagnosis.evidence import evidence_sections
from mocobot_report.diagnosis.gain import gain_section
from mocobot_report.diagnosis.residuals import residual_sections
from mocobot_report.diagnosis.rest import rest_sections
from mocobot_report.folder import Diagnosed
from mocobot_report.sources import sources
from mocobot_view.facts.diagnosis import VERDICTS, read_diagnosis
from mocobot_view.pictures.shots import axis_shot, diagnosis_shot

Values = Mapping[str, Any]
KINDS = {"consistent": "good", "explained": "good", "partly_explained": "warn", "unexplained": "bad"}
MEANING = {
    "consistent": "The simulation explains the recordings within noise and tolerances; nothing is named.",
    "explained": "The named causes explain what the simulation got wrong.",
    "partly_explained": "The named causes are there, but something else is wrong, too.",
    "unexplained": "Recordings and simulation differ, and no cause of the catalogue accounts for it.",
}


def is_axis(diagnosed: Diagnosed) -> bool:
    """Whether the EMPS axis was diagnosed, not a team."""
    provenance = diagnosed.provenance
    options = provenance.get("options") if isinstance(provenance, dict) else None
    if isinstance(options, dict) and "rig" in options:
        return options["rig"] == "emps"
    return not (diagnosed.values["gain"] or {}).get("estimates")


def title(diagnosed: Diagnosed) -> str:
    """The verdict in a word or two, and what it is of."""
    of = " of the EMPS axis" if is_axis(diagnosed) else ""
    return f"Diagnosis{of}: {VERDICTS[diagnosed.values['verdict']].lower()}"


def answer(diagnosed: Diagnosed) -> list[Node]:
    """Verdict, causes in words, and what they are worth."""
    values = diagnosed.values
    count = len(values["recordings"])
    if is_axis(diagnosed):
        what = f"One recording of a real axis (the EMPS benchmark), in {count} blocks that validate each other, is"
    elif count == 1:
        what = "One recording of a team that carries a payload is"
    else:
        what = f"{count} recordings of a team that carries one payload are"
    lede = paragraph(
        f"{what} held against the simulation: where do they part, which physical cause does it, and "
        "what is it worth to "
        "have it in the simulation?",
        kind="lede",
    )
    meaning = MEANING[values["verdict"]]
    if len(values["causes"]) == 1:
        meaning = meaning.replace("causes explain", "cause explains").replace("causes are", "cause is")
    box = verdict(KINDS[values["verdict"]], VERDICTS[values["verdict"]], meaning)
    if values["causes"]:
        box.append(bullets([tidy(cause["sentence"]) for cause in values["causes"]]))
    elif values["verdict"] != "consistent":
        box.append(el("p", tidy(values["residual"]["nominal"]["signature"]["sentence"])))
    return [lede, box, tiles(_tiles(values))]


def _tiles(values: Values) -> list[tuple[str, str, str]]:
    residual, named = values["residual"], values["causes"]
    out = [("misfit as simulated", plain(residual["nominal"]["chi2_per_n"]), "chi²/n; 1 is clean")]
    if named:
        out.append(("misfit with the named causes", plain(residual["chi2_per_n"]), "chi²/n"))
        held = [c["explained"]["held_out"] for c in named if c["explained"]["held_out"] is not None]
        if len(named) == 1:
            text = "on trials not used for the fit" if held else "of the misfit, in sample; not validated"
            share = held[0] if held else named[0]["explained"]["in_sample"]
            out.append(("the cause explains", percent(share), text))
        else:
            out.append(("named causes", str(len(named)), f"{len(held)} of them tested on held-out data"))
    else:
        out.append(("misfit within tolerances", plain(residual["chi2_per_n_tolerated"]), "chi²/n"))
    gain = values["gain"]
    if gain and gain["removed"] is not None and named:
        low, high = gain["removed"]["interval"]
        interval = f"95 %: {percent(low)} to {percent(high)}" if low is not None and high is not None else ""
        out.append(("excess error of the response removed", percent(gain["removed"]["share"]), interval))
    elif values["not_simulated"]:
        out.append(("closed loop", "not simulated", tidy(str(values["not_simulated"]))))
    return out


def sections(book: Book, diagnosed: Diagnosed) -> list[Node]:
    """Everything below the answer."""
    book.say("diagnosis")
    values = diagnosed.values
    names = short_names(list(values["recordings"]))
    blocks = []
    if values["causes"]:
        blocks.append(section(book, "Causes", *_picture(book, diagnosed), *_causes(book, values)))
    elif picture := _picture(book, diagnosed):
        blocks.append(section(book, "The machine", *picture))
    gain = gain_section(book, values, names)
    blocks += [gain] if gain is not None else []
    blocks += residual_sections(book, diagnosed, names)
    blocks += evidence_sections(book, diagnosed, names)
    blocks += rest_sections(book, diagnosed)
    return blocks


def _picture(book: Book, diagnosed: Diagnosed) -> list[Node]:
    if is_axis(diagnosed):
        return [book.gallery.ask([("The axis", partial(axis_shot, ASPECT))])]
    estimates = (diagnosed.values["gain"] or {}).get("estimates")
    if not estimates:
        return []
    causes = read_diagnosis(diagnosed.folder).causes
    caption = "Where the causes sit" if causes else "The team"
    said = []
    for source in sources(diagnosed.provenance, diagnosed.folder):
        recording = source.read()
        if not isinstance(recording, str):
            made = partial(diagnosis_shot, recording, _grasped(estimates["after"]), causes, aspect=ASPECT)
            return [book.gallery.ask([(caption, made)])]
        said.append(recording)
    return (
        [verdict("warn", "No picture", f"It needs one of the recordings: {'; '.join(said)}.")] if said else []
    )


def _grasped(values: Values) -> PayloadEstimate:
    """The grasps of a diagnosis' estimate; a picture needs no more."""
    grasps = values["grasps"]
    count = len(grasps)
    none = np.zeros((count, count))
    found = GraspEstimate(
        Rotation.from_rotvec([g["R_1i_rotvec_deg"] for g in grasps], degrees=True).as_matrix(),
        np.array([g["p_1i_m"] for g in grasps], dtype=float),
        np.zeros((6 * (count - 1), 6 * (count - 1))),
        none, none, np.zeros(count), np.zeros(count),
    )  # fmt: skip
    return PayloadEstimate(None, count, "staged", found, None, None, None, None, (), (), ())


def _causes(book: Book, values: Values) -> list[Node]:
    head = ["cause", "place", "parameter", "value ± standard error", "unit"]
    rows: list[list[Entry]] = []
    for cause in values["causes"]:
        for k, (name, entry) in enumerate(cause["parameters"].items()):
            words, unit = parameter(name)
            first = (cause["cause"], cause["place"]) if k == 0 else ("", "")
            scale = 1.0
            if unit in ("s", "m", "rad"):
                unit, scale = fitting(unit, abs(entry["value"]))
            se = None if entry["se"] is None else scale * entry["se"]
            rows.append([*first, words, measurement(scale * entry["value"], se), unit])
    out = [table("What is named", head, rows, groups=True)]
    head = ["cause", "place", "in sample [%]", "held out [%]", "folds better", "by chance"]
    rows = []
    for cause in values["causes"]:
        inside, held = cause["explained"]["in_sample"], cause["explained"]["held_out"]
        better = sum(gain > 0 for gain in cause["folds"])
        rows.append(
            [
                cause["cause"], cause["place"], Num(_share(inside)), Num(_share(held)),
                Num(f"{better} of {len(cause['folds'])}" if cause["folds"] else NONE), Num(power(cause["log10_p"])),
            ]
        )  # fmt: skip
    note = (
        "share of the misfit as simulated that goes away; held out: fitted to the other trials; by "
        "chance: probability of so "
        "much evidence in clean data"
    )
    out.append(table("What supports it", head, rows, note=note))
    return [*out, *_rivals(values), *_shapes(values["causes"])]


def _share(share: float | None) -> str:
    return percent(share).removesuffix("\u00a0%")


def _rivals(values: Values) -> list[Node]:
    rows: list[list[Entry]] = []
    advice: dict[str, None] = {}
    for cause in values["causes"]:
        label = f"{cause['cause']} ({cause['place']})"
        alike = [rival for rival in cause["alternatives"] if rival["ambiguous"]]
        if alike:
            advice |= dict.fromkeys(text for entry in [cause, *alike] if (text := entry["separate"]))
        for k, rival in enumerate(cause["alternatives"]):
            rows.append(
                [
                    label if k == 0 else "", f"{rival['cause']} ({rival['place']})", value(rival["evidence_gap"], 3),
                    value(rival["chi2_per_n"], 3), "cannot be told apart" if rival["ambiguous"] else "fits worse",
                ]
            )  # fmt: skip
    if not rows:
        return [
            paragraph(
                "No other cause comes near." if len(values["causes"]) == 1 else "No other causes come near."
            )
        ]
    head = ["named", "alternative", "behind by [nats]", "closed loop chi²/n", "verdict"]
    out = [table("Alternatives", head, rows, note="how much less the rows speak for it", groups=True)]
    if advice:
        box = verdict("warn", "What would tell them apart")
        box.append(bullets(list(advice)))
        out.append(box)
    return out


def _shapes(causes: Sequence[Values]) -> list[Node]:
    """Numbers that change a cause's columns and were chosen, not fitted."""
    entries = []
    for cause in causes:
        named = [(*parameter(name), number) for name, number in cause["shape"].items()]
        said = ", ".join(f"{words} {plain(number, 4)} {unit}".rstrip() for words, unit, number in named)
        if said:
            entries.append((f"{cause['cause']} ({cause['place']})", said))
    return [folded("Shape parameters", facts(entries))] if entries else []
