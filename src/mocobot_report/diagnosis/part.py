"""The part of the page on a diagnosis: verdict, causes, gain, and what the residual says."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from discrepancy.result.read import VERDICTS, read_diagnosis
from discrepancy.result.remains import remains, remedy
from estimator.errors import InputError
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.result import PayloadEstimate
from mocobot_report.blocks.book import Book, section
from mocobot_report.blocks.html import Node
from mocobot_report.blocks.numbers import about, percent, plain
from mocobot_report.blocks.pictures import ASPECT
from mocobot_report.blocks.prose import bullets, paragraph, tidy, tiles, verdict
from mocobot_report.blocks.units import short_names
from mocobot_report.diagnosis.causes import cause_tables
from mocobot_report.diagnosis.doubtful import doubtful_sections
from mocobot_report.diagnosis.evidence import evidence_sections
from mocobot_report.diagnosis.gain import gain_section
from mocobot_report.diagnosis.residuals import residual_sections
from mocobot_report.diagnosis.rest import rest_sections
from mocobot_report.diagnosis.rollouts import rollout_section
from mocobot_report.folder import Diagnosed
from mocobot_report.sources import sources
from mocobot_view.pictures.shots import axis_shot, diagnosis_shot

Values = Mapping[str, Any]
KINDS = {
    "consistent": "good", "miscalibrated": "warn", "explained": "good", "partly_explained": "warn",
    "unexplained": "bad",
}  # fmt: skip
MEANING = {
    "consistent": "The simulation explains the recordings within noise and tolerances; nothing is named.",
    "miscalibrated": "The robots are off by more than their tolerances, all places alike, so none is named.",
    "explained": "The named causes explain what the simulation got wrong.",
    "partly_explained": "The named causes are there, but more than noise is left.",
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
    lede = (
        f"{what} held against the simulation: where do they part, which physical cause does it, and what is it worth "
        "to have it in the simulation?"
    )
    meaning = MEANING[values["verdict"]]
    if len(values["causes"]) == 1:
        meaning = meaning.replace("causes explain", "cause explains").replace("causes are", "cause is")
    said: list[Node | str] = []
    left = remains(values)
    if values["causes"]:
        said = [bullets([tidy(cause["sentence"]) for cause in values["causes"]])]
    elif values["verdict"] == "miscalibrated":
        said = [bullets([tidy(entry["sentence"]) for entry in values["scatter"]]), tidy(remedy(values))]
    elif values["verdict"] != "consistent" and not left:
        said = [tidy(values["residual"]["nominal"]["signature"]["sentence"])]
    kind = KINDS[values["verdict"]]
    # Green stands beside no figure that contradicts it.
    kind = "warn" if left and kind == "good" else kind
    box = verdict(kind, VERDICTS[values["verdict"]], meaning, *said, *map(tidy, left))
    return [paragraph(lede, kind="lede"), box, tiles(_tiles(values))]


def _tiles(values: Values) -> list[tuple[str, str, str]]:
    residual, named = values["residual"], values["causes"]
    out = [("misfit as simulated", plain(residual["nominal"]["chi2_per_n"]), "chi²/n; 1 is clean")]
    if named:
        out.append(("misfit with the named causes", plain(residual["chi2_per_n"]), "chi²/n"))
        held = [c["explained"]["held_out"] for c in named if c["explained"]["held_out"] is not None]
        if len(named) == 1:
            out.append(
                ("probability", percent(named[0]["probability"]), "that it is this cause, at this place")
            )
            text = "on trials not used for the fit" if held else "of the misfit, in sample; not validated"
            share = held[0] if held else named[0]["explained"]["in_sample"]
            out.append(("the cause explains", percent(share), text))
        else:
            out.append(("named causes", str(len(named)), f"{len(held)} of them tested on held-out data"))
    elif values["scatter"]:
        out.append(("misfit with nothing named", plain(residual["chi2_per_n_tolerated"]), "chi²/n"))
        worst = values["scatter"][0]
        out.append((worst["kind"], f"{about(worst['factor'])} ×", "spread over its tolerance"))
        if told := values.get("foretold"):
            of = f"chi²/n of each recording by the others; {plain(told['as_designed'])} as designed"
            out.append(("foretold as found", plain(told["as_found"]), of))
    else:
        out.append(("misfit with nothing named", plain(residual["chi2_per_n_tolerated"]), "chi²/n"))
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
    picture = _picture(book, diagnosed)
    first = None
    if values["causes"]:
        first = section(book, "Causes", picture, cause_tables(values["causes"]))
    elif picture is not None:
        first = section(book, "The machine", picture)
    return [
        *([] if first is None else [first]),
        *doubtful_sections(book, values),
        *([] if (gain := gain_section(book, values, names)) is None else [gain]),
        *([] if (rolled := rollout_section(book, values)) is None else [rolled]),
        *residual_sections(book, diagnosed, names),
        *evidence_sections(book, diagnosed, names),
        *rest_sections(book, diagnosed),
    ]


def _picture(book: Book, diagnosed: Diagnosed) -> Node | None:
    if is_axis(diagnosed):
        return book.gallery.ask([("The axis", partial(axis_shot, ASPECT))])
    estimates = (diagnosed.values["gain"] or {}).get("estimates")
    if not estimates:
        return None
    causes = read_diagnosis(diagnosed.folder).causes
    said = []
    for source in sources(diagnosed.provenance, diagnosed.folder):
        try:
            recording = source.recording()
        except InputError as error:
            said.append(str(error))
            continue
        made = partial(diagnosis_shot, recording, _grasped(estimates["after"]), causes, aspect=ASPECT)
        return book.gallery.ask([("Where the causes sit" if causes else "The team", made)])
    return (
        verdict("warn", "No picture", f"It needs one of the recordings: {'; '.join(said)}.") if said else None
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
