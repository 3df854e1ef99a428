"""The part of the page on a diagnosis: verdict, causes, gain, and what the residual says."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from discrepancy.numbers import one_each, parameter
from discrepancy.result.lines import NEAREST, NOTHING_WRONG_HERE, SAID, label
from discrepancy.result.read import (
    AS_FOUND,
    EXTENDED,
    VERDICTS,
    is_of_joints,
    kind_of,
    name_of,
    read_diagnosis,
)
from discrepancy.result.remains import farthest, remedy, sizes_of
from discrepancy.result.text_gain import foretold_torques
from estimator.errors import InputError
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.result import PayloadEstimate
from estimator.files import LIST
from mocobot_report.blocks.book import Book, section
from mocobot_report.blocks.html import Child, Node, el
from mocobot_report.blocks.numbers import NONE, about, percent, plain, size, spelled
from mocobot_report.blocks.pictures import ASPECT
from mocobot_report.blocks.prose import bullets, facts, folded, paragraph, tidy, tiles, verdict
from mocobot_report.blocks.tables import Entry, Num, measurement, table, value
from mocobot_report.blocks.units import short_names
from mocobot_report.diagnosis.evidence import evidence_sections, residual_sections, rollout_section
from mocobot_report.diagnosis.gain import gain_section
from mocobot_report.diagnosis.keys import cause_name, chance_of, numbers_of, sentence_of, share_of
from mocobot_report.folder import Diagnosed
from mocobot_report.sources import sources
from mocobot_view.pictures import diagnosis_shot

Values = Mapping[str, Any]


def cause_tables(causes: Sequence[Values]) -> list[Node]:
    """What is named, what supports it, and what else it might be."""
    units = one_each(
        (_said(cause, name)[1], entry["value"]) for cause in causes for name, _, entry in numbers_of(cause)
    )
    sizes: list[list[Entry]] = []
    support: list[list[Entry]] = []
    for cause in causes:
        who = cause_name(name_of(cause), cause["cause"])
        # A number without an error that is 0 is of a form that the cause does not have.
        there = [number for number in numbers_of(cause) if number[2]["value"] or number[2]["se"] is not None]
        for k, (name, at, entry) in enumerate(there):
            words, unit = _said(cause, name)
            unit, scale = units[unit] if unit in ("s", "m", "rad", "m/N") else (unit, 1.0)
            se = None if entry["se"] is None else scale * entry["se"]
            shown = measurement(scale * entry["value"], se, spelled(unit))
            sizes.append([who if k == 0 else "", shown, f"{words}, {at}" if at else words])
        shares = (Num(share_of(cause["explained"][kind])) for kind in ("in_sample", "held_out"))
        folds = cause["folds"]
        better = f"{sum(gain > 0 for gain in folds)} of {len(folds)}" if folds else NONE
        chance = Num(share_of(cause["probability"]))
        support.append([tidy(name_of(cause)), chance, *shares, Num(better)])
    if len(causes) > 1:
        each = ([cause["explained"][kind] for cause in causes] for kind in ("in_sample", "held_out"))
        sums = [Num(NONE) if None in shares else Num(share_of(sum(shares))) for shares in each]
        support.append(["All together", Num(""), *sums, Num("")])
    note = (
        "probability: that it is this cause, at this place; share of the misfit as simulated that a cause removes "
        "beyond those above it, so that shares add up; held out: fitted to the other trials"
    )
    supports = ["cause", "probability [%]", "in sample [%]", "held out [%]", "folds better"]
    return [
        table(
            "What is named", ["cause", "value ± standard error", "parameter"], sizes, groups=True, stack=True
        ),
        table("What supports it", supports, support, note=note, stack=True),
        *_rivals(causes),
        *_shapes(causes),
    ]


def _said(cause: Values, name: str) -> tuple[str, str]:
    """A parameter's name in words and its unit: a law brings its own, others carry theirs in the name."""
    law = cause.get("law")
    return (
        parameter(name) if law is None else (name.removesuffix("_rad").replace("_", " "), law["units"][name])
    )


def _rivals(causes: Sequence[Values]) -> list[Node]:
    rows: list[list[Entry]] = []
    farther: list[list[Entry]] = []
    advice: dict[str, None] = {}
    for cause in causes:
        alike = [rival for rival in cause["alternatives"] if rival["ambiguous"]]
        if alike:
            advice |= dict.fromkeys(text for entry in [cause, *alike] if (text := entry["separate"]))
        near, far = _apart(cause["alternatives"])
        named = tidy(name_of(cause))
        farther += [[named if k == 0 else "", *_rival(rival)] for k, rival in enumerate(far)]
        for rival in near:
            rows.append([named, *_rival(rival)])
            named = ""
        for which, words in (
            ("unlisted", "something unlisted"),
            ("nothing", "nothing at all"),
        ):
            behind = value(cause["over_nothing"] if which == "nothing" else None)
            rows.append([named, words, Num(chance_of(cause["instead"][which])), behind, Num(NONE)])
            named = ""
    head = ["named", "what else", "chance [%]", "behind [nats]", "loop chi²/n"]
    note = "probability and nats: by the rows; with that of the cause the probabilities add up to 100 %"
    out = [table("What else it might be", head, rows, note=note, groups=True, stack=True)]
    if farther:
        out.append(
            folded("What fits worse still", table("Farther behind", head, farther, groups=True, stack=True))
        )
    return [*out, verdict("warn", "What would tell them apart", bullets(list(advice)))] if advice else out


def _apart(rivals: Sequence[Values]) -> tuple[list[Values], list[Values]]:
    """What could be there instead and the nearest of what could not, which the report names, too; and the others."""
    near: list[Values] = []
    far: list[Values] = []
    for rival in rivals:
        likely = rival["ambiguous"] or rival["probability"] >= SAID
        worse = sum(not one["ambiguous"] for one in near)
        (near if likely or worse < NEAREST else far).append(rival)
    return near, far


def _rival(rival: Values) -> list[Entry]:
    """Its row but for whose it is."""
    said = "cannot be told apart" if rival["ambiguous"] else "fits worse"
    other = el("span", cause_name(name_of(rival), rival["cause"]), " ", el("em", said))
    gap, chi2 = value(rival["evidence_gap"]), value(rival["chi2_per_n"])
    return [other, Num(chance_of(rival["probability"])), gap, chi2]


def _shapes(causes: Sequence[Values]) -> list[Node]:
    """Numbers that change a cause's columns and were chosen, not fitted."""
    entries = []
    for cause in causes:
        named = ((*_said(cause, name), number) for name, number in cause["shape"].items())
        said = ", ".join(
            f"{words} {plain(number, 4)} {spelled(unit)}".rstrip() for words, unit, number in named
        )
        if said:
            entries.append((tidy(name_of(cause)), said))
    return [folded("Shape parameters", facts(entries))] if entries else []


def doubtful_sections(book: Book, values: Values) -> list[Node]:
    """Kinds that scatter, and suspected causes, where there are any."""
    out = []
    if values["scatter"]:
        out.append(
            section(
                book,
                "Off at all places alike",
                paragraph(tidy(remedy(values))),
                _scatter(values),
                _places(values),
            )
        )
    if values["suspected"]:
        out.append(section(book, "Suspected", _suspected(values)))
    return out


def _scatter(values: Values) -> Node:
    rows: list[list[Entry]] = [
        [
            cause_name(entry["kind"], entry["cause"]),
            tidy(sizes_of(entry, "spread"), inside=True),
            tidy(sizes_of(entry, "tolerance"), inside=True),
            Num(about(entry["factor"])),
            Num(str(entry["places"])),
            value(entry["nats"]),
        ]
        for entry in values["scatter"]
    ]
    return table(
        "Kinds that scatter more than their tolerance",
        ["cause", "spread", "tolerance", "factor", "places", "likelier by [nats]"], rows, stack=True,
        note="standard deviation over all places, learnt from the recordings",
    )  # fmt: skip


def _places(values: Values) -> Node | None:
    """The places of every kind that are farthest off."""
    told = [(entry, farthest(entry)) for entry in values["scatter"]]
    said = [f"{kind_of(entry)}: farthest off are {where}" for entry, where in told if where]
    return bullets([tidy(f"{text[:1].upper()}{text[1:]}.") for text in said]) if said else None


def _suspected(values: Values) -> Node:
    rows: list[list[Entry]] = [
        [
            cause_name(label(entry), entry["cause"]),
            Num(chance_of(entry["probability"])),
            value(entry["over_nothing"]),
            tidy(entry["sentence"]),
        ]
        for entry in values["suspected"]
    ]
    head = ["cause", "probability [%]", "over nothing [nats]", "it would be"]
    return table("Too improbable to be named", head, rows, stack=True)


def rest_sections(book: Book, diagnosed: Diagnosed) -> list[Node]:
    """Detection limits, undecidable questions, the extended models' files, notes."""
    values = diagnosed.values
    limits = _limits(values) if values["detection_limits"] else None
    if limits is not None and values["verdict"] not in NOTHING_WRONG_HERE:
        limits = folded("Show the limits", limits)
    entries = [
        (el("dt", tidy(entry["what"])), el("dd", tidy(f"{entry['why']}; needs {entry['remedy']}.")))
        for entry in values["undecidable"]
    ]
    notes = [tidy(note) for note in values["notes"]]
    outline = [
        ("What would have been noticed", limits),
        ("What such recordings cannot decide", el("dl", entries, class_="list") if entries else None),
        ("Models to take away", _models(diagnosed.folder)),
        ("Notes", bullets(notes) if notes else None),
    ]
    return [section(book, name, content) for name, content in outline if content is not None]


def _limits(values: Values) -> Node:
    """One row per cause and parameter: smallest and largest limit over the places."""
    sizes: dict[tuple[str, str], list[float | None]] = {}
    kinds = {entry["cause"]: kind_of(entry) for entry in values["detection_limits"]}
    for entry in values["detection_limits"]:
        for name, limit in entry["parameters"].items():
            sizes.setdefault((entry["cause"], name), []).append(limit)
    shown = one_each(
        (parameter(name)[1], limit)
        for (_, name), found in sizes.items()
        for limit in found
        if limit is not None
    )
    rows: list[list[Entry]] = []
    last = ""
    for (cause, name), found in sizes.items():
        words, unit = parameter(name)
        unit, scale = shown.get(unit, (unit, 1.0))
        seen = sorted(scale * limit for limit in found if limit is not None)
        blind = len(found) - len(seen)
        sizes_said = Num("never")
        where = f"nowhere: these recordings say nothing ({len(found)} places)"
        if seen:
            low, high = plain(seen[0], 2), plain(seen[-1], 2)
            sizes_said = Num(low if low == high else f"{low} to {high}", unit=spelled(unit))
            where = f"{len(seen)} of {len(found)}" if blind else "everywhere"
        who = cause_name(kinds[cause], cause) if cause != last else ""
        rows.append([who, words, sizes_said, where])
        last = cause
    return table(
        "Size that would have been noticed nine times in ten", ["cause", "parameter", "best to worst place",
        "seen at"], rows, groups=True, stack=True,
        note="had it been there, in these very recordings",
    )  # fmt: skip


def _models(folder: Path) -> list[Node] | None:
    there = {name: files for name in (EXTENDED, AS_FOUND) if (files := _files(folder / name))}
    if not there:
        return None
    said = [
        paragraph(*_told(name, files), " Its own README says what is where.") for name, files in there.items()
    ]
    rows = [
        [el("code", path.relative_to(folder).as_posix()), Num(size(path.stat().st_size))]
        for files in there.values()
        for path in files
    ]
    return [*said, table("Files beside this report", ["file", "size"], rows)]


def _told(name: str, files: Sequence[Path]) -> list[Child]:
    takes = el("code", f"mocobot simulate --model {name}")
    if name == AS_FOUND:
        how = "The estimated team with every part as far off as it is found, within its tolerance, too: "
        return [how, takes, " takes the folder."]
    if any(path.name == "team.xml" for path in files):
        loads = el("code", "team.xml")
        named = "The estimated team with the named causes in it: "
        return [named, loads, " loads in plain MuJoCo, and ", takes, " takes the folder."]
    return ["The model with the named causes in it; it loads in plain MuJoCo."]


def _files(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.rglob("*") if path.is_file() and path.name != LIST)
    except OSError:
        return []


KINDS = {
    "consistent": "good", "miscalibrated": "warn", "explained": "good", "partly_explained": "warn",
    "unexplained": "bad",
}  # fmt: skip
MEANING = {
    "consistent": "The simulation explains the recordings within noise and tolerances; nothing is named.",
    "miscalibrated": "All places of a kind are off by more than their tolerances, so none is named.",
    "explained": "The named causes explain what the simulation got wrong.",
    "partly_explained": "The named causes are there, but do not explain all.",
    "unexplained": "Recordings and simulation differ, and no cause of the catalogue accounts for it.",
}


def is_robot(diagnosed: Diagnosed) -> bool:
    """Whether logs of one robot's joints were diagnosed, not a team's recordings."""
    if is_of_joints(diagnosed.values):
        return True
    provenance = diagnosed.provenance
    options = provenance.get("options") if isinstance(provenance, dict) else None
    return isinstance(options, dict) and options.get("model") is not None


def title(diagnosed: Diagnosed) -> str:
    """The verdict in a word or two, and what it is of."""
    of = " of a robot" if is_robot(diagnosed) else ""
    return f"Diagnosis{of}: {VERDICTS[diagnosed.values['verdict']].lower()}"


def answer(diagnosed: Diagnosed) -> list[Node]:
    """Verdict, causes in words, and what they are worth."""
    values = diagnosed.values
    count = len(values["recordings"])
    if is_robot(diagnosed):
        what = "One trial of a robot's joints is" if count == 1 else f"{count} trials of a robot's joints are"
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
    left = values["remains"]
    if values["causes"]:
        said = [bullets([sentence_of(cause) for cause in values["causes"]])]
    elif values["verdict"] == "miscalibrated":
        said = [bullets([tidy(entry["sentence"]) for entry in values["scatter"]]), tidy(remedy(values))]
    elif values["verdict"] != "consistent" and not left:
        said = [tidy(values["residual"]["nominal"]["signature"]["sentence"])]
    kind = KINDS[values["verdict"]]
    # Green stands beside no figure that contradicts it.
    stopped = [] if values.get("finished", True) else ["The search was stopped before its end."]
    kind = "warn" if (left or stopped) and kind == "good" else kind
    box = verdict(kind, VERDICTS[values["verdict"]], meaning, *stopped, *said, *map(tidy, left))
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
        of = "foretold torques" if foretold_torques(gain) else "response"
        out.append((f"excess error of the {of} removed", percent(gain["removed"]["share"]), interval))
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
