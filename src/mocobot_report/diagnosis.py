"""Report of a diagnosis: verdict, causes and their rivals, benefit of fixing them, and open questions."""

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from scipy.spatial.transform import Rotation

from discrepancy.numbers import one_each, parameter
from discrepancy.result.read import (
    AS_FOUND,
    EXTENDED,
    VERDICTS,
    is_of_joints,
    kind_of,
    name_of,
    read_diagnosis,
)
from discrepancy.result.remains import all_as_found, farthest, remedy, sizes_of
from discrepancy.result.report import NEAREST, NOTHING_WRONG_HERE, SAID, label
from discrepancy.result.tables import (
    ERRORS,
    blocks,
    diverged_sentences,
    floor_words,
    lost,
    predicted_torques,
    response_units,
    shown_units,
    something_is_off,
)
from estimator.errors import InputError
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.result import PayloadEstimate
from estimator.files import LIST
from mocobot_report import residuals
from mocobot_report.charts import Chart, Key, column_axis, dots, literal, log_axis, rule
from mocobot_report.folder import Diagnosed, Result, sources
from mocobot_report.numbers import (
    NONE,
    about,
    counted,
    percent,
    plain,
    probability,
    short_names,
    size,
    spelled,
    spelled_text,
    tidy,
    without_percent,
)
from mocobot_report.tables import (
    Entry,
    Num,
    cause_name,
    chance_of,
    measurement,
    numbers_of,
    sentence_of,
    value,
)
from mocobot_view.pictures import diagnosis_shot

Values = Mapping[str, Any]
Rows = list[list[Entry]]
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
MOST_NAMED = 2  # largest number of causes in the title. Chosen.


def context(result: Result, say: Callable[[str], object]) -> dict[str, Any]:
    """Return the data of ``assets/diagnosis.html``."""
    say("diagnosis")
    found: Diagnosed = result.found
    values = found.values
    names = short_names(list(values["recordings"]))
    robot, (pictures, no_picture) = _is_robot(result), _pictures(result)
    return {
        "title": _title(values, robot=robot),
        "values": values,
        "robot": robot,
        "verdicts": VERDICTS,
        "verdict_kind": _verdict_kind(values),
        "meaning": _meaning(values),
        "said": _said(values),
        "tiles": _tiles(values),
        "pictures": pictures,
        "no_picture": no_picture,
        **_causes(values["causes"]),
        "scatter": _scatter(values["scatter"]),
        "places_off": _places_off(values["scatter"]),
        "remedy": tidy(remedy(values)) if values["scatter"] else "",
        "suspected": _suspected(values["suspected"]),
        "gain": _gain(values, names),
        "rollouts": _rollouts(values.get("rollouts")),
        "torques": residuals.torques(found, names),
        "residuals": residuals.residuals(found, names, say),
        "places": residuals.places(values, names),
        "evidence": residuals.evidence(values),
        "limits": _limits(values["detection_limits"]),
        "limits_folded": values["verdict"] not in NOTHING_WRONG_HERE,
        "models": _models(result.path.parent),
    }


def _is_robot(result: Result) -> bool:
    """Whether the diagnosis is of a single robot instead of a team."""
    options = (result.provenance or {}).get("options")
    named = isinstance(options, dict) and options.get("model") is not None
    return named or is_of_joints(result.found.values)


def _title(values: Values, *, robot: bool) -> str:
    """Write the title: the number of trials and the named causes."""
    names = [name_of(cause) for cause in values["causes"]]
    found = ", ".join(names[:MOST_NAMED])
    if len(names) > MOST_NAMED:
        found += f" and {len(names) - MOST_NAMED} more"
    of = (
        f"a robot in {counted(len(values['recordings']), 'trial')}"
        if robot
        else counted(len(values["recordings"]), "trial")
    )
    return f"Diagnosis of {of}: {found or VERDICTS[values['verdict']].lower()}"


def _verdict_kind(values: Values) -> str:
    """Return the colour of the verdict: warn instead of good if something remains or the search did not finish."""
    kind = KINDS[values["verdict"]]
    doubt = values["remains"] or not values.get("finished", True)
    return "warn" if doubt and kind == "good" else kind


def _meaning(values: Values) -> str:
    meaning = MEANING[values["verdict"]]
    if len(values["causes"]) == 1:
        meaning = meaning.replace("causes explain", "cause explains").replace("causes are", "cause is")
    return meaning


def _said(values: Values) -> dict[str, Any]:
    """Return the sentences in the box of the verdict: a list and a closing sentence."""
    if values["causes"]:
        return {"list": [sentence_of(cause) for cause in values["causes"]], "then": ""}
    if values["verdict"] == "miscalibrated":
        listed = [tidy(entry["sentence"]) for entry in values["scatter"]]
        return {"list": listed, "then": tidy(remedy(values))}
    if values["verdict"] != "consistent" and not values["remains"]:
        return {"list": [], "then": tidy(values["residual"]["nominal"]["signature"]["sentence"])}
    return {"list": [], "then": ""}


def _tiles(values: Values) -> list[tuple[str, str, str]]:
    residual, named, gain = values["residual"], values["causes"], values["gain"]
    out = [("misfit as simulated", plain(residual["nominal"]["chi2_per_n"]), "chi²/n; 1 is clean")]
    if named:
        out.append(("misfit with the named causes", plain(residual["chi2_per_n"]), "chi²/n"))
        explained = [cause["explained"] for cause in named]
        held = [one["held_out"] for one in explained if one["held_out"] is not None]
        if len(named) == 1:
            chance = probability(named[0]["probability"])
            out.append(("probability", chance, "that it is this cause, at this place"))
            text = "on trials not used for the fit" if held else "of the misfit, in sample; not validated"
            out.append(("the cause explains", percent(held[0] if held else explained[0]["in_sample"]), text))
        else:
            out.append(("named causes", str(len(named)), f"{len(held)} of them tested on held-out data"))
    else:
        out.append(("misfit with nothing named", plain(residual["chi2_per_n_tolerated"]), "chi²/n"))
    if values["scatter"] and not named:
        worst = values["scatter"][0]
        out.append((worst["kind"], f"{about(worst['factor'])} ×", "spread over its tolerance"))
    if gain and gain["removed"] is not None and named:
        low, high = gain["removed"]["interval"]
        interval = f"95 %: {percent(low)} to {percent(high)}" if low is not None and high is not None else ""
        of = "predicted torques" if predicted_torques(gain) else "response"
        out.append((f"excess error of the {of} removed", percent(gain["removed"]["share"]), interval))
    elif values["not_simulated"]:
        out.append(("closed loop", "not simulated", tidy(str(values["not_simulated"]))))
    return out


def _share(share: float | None) -> Num:
    return Num(without_percent(percent(share)))


def _causes(causes: Sequence[Values]) -> dict[str, Any]:
    """Make the tables of the named causes: parameters, support and rivals."""
    units = one_each(
        (_parameter(cause, name)[1], entry["value"])
        for cause in causes
        for name, _, entry in numbers_of(cause)
    )
    sizes: Rows = []
    support: Rows = []
    for cause in causes:
        # A zero without standard error belongs to a variant of the cause that does not apply.
        there = [number for number in numbers_of(cause) if number[2]["value"] or number[2]["se"] is not None]
        for k, (name, at, entry) in enumerate(there):
            words, unit = _parameter(cause, name)
            unit, scale = units[unit] if unit in ("s", "m", "rad", "m/N") else (unit, 1.0)
            se = None if entry["se"] is None else scale * entry["se"]
            shown = measurement(scale * entry["value"], se, spelled(unit))
            who = "" if k else cause_name(name_of(cause), cause["cause"])
            sizes.append([who, shown, f"{words}, {at}" if at else words])
        folds, explained = cause["folds"], cause["explained"]
        better = f"{sum(gain > 0 for gain in folds)} of {len(folds)}" if folds else NONE
        shares = [_share(explained[kind]) for kind in ("in_sample", "held_out")]
        support.append([tidy(name_of(cause)), Num(chance_of(cause["probability"])), *shares, Num(better)])
    if len(causes) > 1:
        each = [[cause["explained"][kind] for cause in causes] for kind in ("in_sample", "held_out")]
        sums = [_share(None if None in shares else sum(shares)) for shares in each]
        support.append(["All together", Num(""), *sums, Num("")])
    near, far, advice = _rivals(causes)
    return {
        "named": sizes, "support": support, "rivals": near, "farther": far, "advice": advice, "shapes": _shapes(causes),
    }  # fmt: skip


def _parameter(cause: Values, name: str) -> tuple[str, str]:
    """Return a parameter's name in words and its unit, which a law states separately and others have in the name."""
    law = cause.get("law")
    words = name.removesuffix("_rad").replace("_", " ")
    return parameter(name) if law is None else (words, law["units"][name])


def _rivals(causes: Sequence[Values]) -> tuple[Rows, Rows, list[str]]:
    """Make rows of the near and the far rivals of each cause, and advice on how to distinguish the near ones."""
    rows: Rows = []
    farther: Rows = []
    advice: dict[str, None] = {}
    for cause in causes:
        alike = [rival for rival in cause["alternatives"] if rival["ambiguous"]]
        if alike:
            advice |= dict.fromkeys(text for entry in [cause, *alike] if (text := entry["separate"]))
        near, far = _apart(cause["alternatives"])
        mine = [_rival(rival) for rival in near]
        for which, words in (("unlisted", "something unlisted"), ("nothing", "nothing at all")):
            behind = value(cause["over_nothing"] if which == "nothing" else None)
            mine.append([words, Num(chance_of(cause["instead"][which])), behind, Num(NONE)])
        named = tidy(name_of(cause))
        rows += [[named if k == 0 else "", *row] for k, row in enumerate(mine)]
        farther += [[named if k == 0 else "", *_rival(rival)] for k, rival in enumerate(far)]
    return rows, farther, list(advice)


def _apart(rivals: Sequence[Values]) -> tuple[list[Values], list[Values]]:
    """Split rivals into those that the text report also names (plausible or nearest) and the others."""
    near: list[Values] = []
    far: list[Values] = []
    for rival in rivals:
        likely = rival["ambiguous"] or rival["probability"] >= SAID
        worse = sum(not one["ambiguous"] for one in near)
        (near if likely or worse < NEAREST else far).append(rival)
    return near, far


def _rival(rival: Values) -> list[Entry]:
    """Make the cells of a rival, without the name of the cause."""
    said = "cannot be told apart" if rival["ambiguous"] else "fits worse"
    other = Markup("{} <em>{}</em>").format(cause_name(name_of(rival), rival["cause"]), said)
    chance = Num(chance_of(rival["probability"]))
    return [other, chance, value(rival["evidence_gap"]), value(rival["chi2_per_n"])]


def _shapes(causes: Sequence[Values]) -> list[tuple[str, str]]:
    """List the shape parameters of causes, which were chosen instead of fitted."""
    entries = []
    for cause in causes:
        named = [(*_parameter(cause, name), number) for name, number in cause["shape"].items()]
        said = [f"{words} {plain(number, 4)} {spelled(unit)}".rstrip() for words, unit, number in named]
        if said:
            entries.append((tidy(name_of(cause)), ", ".join(said)))
    return entries


def _scatter(scatter: Sequence[Values]) -> Rows:
    return [
        [
            cause_name(entry["kind"], entry["cause"]), tidy(sizes_of(entry, "spread"), inside=True),
            tidy(sizes_of(entry, "tolerance"), inside=True), Num(about(entry["factor"])), Num(str(entry["places"])),
            value(entry["nats"]),
        ]
        for entry in scatter
    ]  # fmt: skip


def _places_off(scatter: Sequence[Values]) -> list[str]:
    """Name the places with the largest deviations, for every kind."""
    told = [(kind_of(entry), farthest(entry)) for entry in scatter]
    return [tidy(f"{kind[:1].upper()}{kind[1:]}: farthest off are {where}.") for kind, where in told if where]


def _suspected(suspected: Sequence[Values]) -> Rows:
    return [
        [
            cause_name(label(entry), entry["cause"]), Num(chance_of(entry["probability"])),
            value(entry["over_nothing"]), tidy(entry["sentence"]),
        ]
        for entry in suspected
    ]  # fmt: skip


BEFORE = Key("before", "as simulated", "before", "square")
AFTER = Key("after", "with the causes", "after", "circle")
ERROR = Key("before", "error", "before", "square")


def _gain(values: Values, names: Sequence[str]) -> dict[str, Any] | None:
    """Make the section on the closed loop, errors and estimates; None if the JSON has none of them."""
    gain, named, known = values["gain"], bool(values["causes"]), something_is_off(values)
    if gain is None:
        return None
    out: dict[str, Any] = {"loop": None, "errors": None, "estimates": None, "not_simulated": None}
    if gain["held_out"]["before"] is not None and gain["held_out"]["after"] is not None:
        shown = {"before": BEFORE, "after": AFTER} if named else {"before": ERROR}
        out["loop"] = _closed_loop(gain, dict(zip(values["recordings"], names, strict=True)), shown)
    elif values["not_simulated"]:
        out["not_simulated"] = tidy(f"{values['not_simulated']}.")
    if "errors" in gain:
        out["errors"] = _errors(gain["errors"], ["before", "after"] if known else ["before"])
    if gain.get("estimates") and known:
        out["estimates"] = _estimates(gain["estimates"])
    if not any(out.values()):
        return None
    title = "What the causes are worth" if named else "Response to the commands"
    return out | {"title": "What it is worth to know the robots" if known and not named else title}


def _heads(shown: Collection[str]) -> list[str]:
    return list(shown) if len(shown) > 1 else ["error"]


def _errors(errors: Values, shown: Collection[str]) -> dict[str, Any]:
    parts = {key: name.rstrip("]").split(" [") for key, name in ERRORS.items()}
    cells = {key: [value(errors[which][key], 3) for which in shown] for key in parts}
    rows = [[name[0], name[-1], *cells[key]] for key, name in parts.items()]
    return {"head": ["error of", "unit", *_heads(shown)], "rows": rows}


def _closed_loop(gain: Values, short: Mapping[str, str], shown: Mapping[str, Key]) -> dict[str, Any]:
    """Make sentences, rows and charts on the response to the commands, or on the predicted torques."""
    removed, range_said = None, ""
    if gain["removed"] is not None and "after" in shown:
        low, high = gain["removed"]["interval"]
        removed = percent(gain["removed"]["share"])
        count = sum(t["before"] is not None and t["after"] is not None for t in gain["trials"])
        if low is not None and high is not None and count > 1:
            range_said = f" (95 % interval over {count} trials: {percent(low)} to {percent(high)})"
    # Only the first part of a long recording is simulated again.
    trials = [short[trial["name"]] for trial in gain["trials"]]
    keys = [*(f"{channel}_rms" for channel in gain["units"]), "chi2_per_n"]
    heads = _heads(shown)
    return {
        "torques": predicted_torques(gain),
        "validated": gain["validated"],
        "removed": removed,
        "interval": range_said,
        "as_found": list(all_as_found(gain)),
        "head": ["channel", "unit", *heads, "noise alone", *(f"{name} / motion [%]" for name in heads)],
        "rows": _response(gain, shown),
        "keys": [*shown.values(), Key("", floor_words(gain), "text", "dash")],
        "charts": [_trials_chart(gain, key, trials, shown) for key in keys],
    }


def _response(gain: Values, shown: Mapping[str, Key]) -> Rows:
    """Tabulate the error of every channel, absolute and relative to its motion."""
    held = [gain["held_out"][which] for which in shown]
    rows: Rows = []
    for channel, (unit, scale) in response_units(gain).items():
        errors = [value(scale * w[f"{channel}_rms"], 3) for w in (*held, gain["noise"])]
        shares = [value(100.0 * w[f"{channel}_nrmse"], 2) for w in held]
        rows.append([channel, spelled(unit), *errors, *shares])
    chi2 = [value(w["chi2_per_n"], 3) for w in held]
    return [*rows, ["chi²/n", "", *chi2, Num("1"), *(Num(NONE) for _ in held)]]


def _trials_chart(gain: Values, key: str, names: Sequence[str], shown: Mapping[str, Key]) -> Chart:
    """Plot one dot per trial, before and after, with the noise floor dashed; ``key`` names the error."""
    trials, channel = gain["trials"], key.removesuffix("_rms")
    unit, scale, floor, title = "", 1.0, 1.0, "chi²/n"
    if channel != key:
        unit, scale = response_units(gain)[channel]
        unit = spelled(unit)
        floor, title = scale * gain["noise"][key], f"{channel} rms"
    data, seen = [], [floor]
    for which, entry in shown.items():
        values = [None if t[which] is None else scale * t[which][key] for t in trials]
        text = [f"{name}, {entry.label}: {plain(v)} {unit}" for name, v in zip(names, values, strict=True)]
        data.append(dots(range(len(trials)), values, entry, text, size=10))
        seen += values
    fit = len(names) <= 6 and all(len(name) <= 40 // len(names) for name in names)
    across = column_axis([literal(name) if fit else str(k) for k, name in enumerate(names, start=1)])
    up = log_axis(f"{title} [{unit}]" if unit else title, seen)
    torques = predicted_torques(gain)
    of = "predicted torques" if torques else "simulated response"
    said = f"{title} of every trial's {of}, before and after; the means are in the table."
    layout = {"xaxis": across, "yaxis": up, "margin": {"b": 26}, "shapes": [rule(y=floor)]}
    return Chart(f"{'Predicted' if torques else 'Response'}: {title}", said, data, layout, 230)


def _estimates(estimates: Values) -> Rows:
    """Tabulate the payload estimate before and after."""
    rows: Rows = []

    def row(name: str, unit: str, read: Callable[[Values], Any], scale: float = 1.0) -> None:
        before, after = (scale * float(read(estimates[which])) for which in ("before", "after"))
        rows.append([name, unit, value(before, 6), value(after, 6), value(after - before, 2)])

    row("mass", "kg", lambda e: e["mass_kg"])
    for k, name in enumerate("xyz"):
        row(f"p_1c {name}", "mm", lambda e, k=k: e["p_1c_m"][k], 1e3)
    for k in range(3):
        row(f"principal moment {k + 1}", "kg m²", lambda e, k=k: e["principal_inertia_kgm2"][k])
    for i in range(1, len(estimates["before"]["grasps"])):
        row(f"|p_1{i + 1}|", "mm", lambda e, i=i: np.linalg.norm(e["grasps"][i]["p_1i_m"]), 1e3)
    return rows


def _rollouts(rolled: Values | None) -> dict[str, Any] | None:
    """Make the section on free rollouts and the closed loop of a single robot; None if the JSON has none."""
    if rolled is None:
        return None
    loop = rolled["commanded"]
    return {
        "why_not": rolled["why_not"], "free": _free(rolled) if rolled["why_not"] is None else None,
        "why_no_loop": loop["why_not"], "loop": _commanded(rolled, loop) if loop["why_not"] is None else None,
    }  # fmt: skip


def _free(rolled: Values) -> dict[str, Any]:
    more = [*diverged_sentences(rolled), *rolled["refused"]]
    if rolled["not_simulated"]:
        more.append(f"Not in the rollouts: {', '.join(rolled['not_simulated'])}.")
    rows: Rows = []
    for j in range(len(rolled["joints"])):
        for k, horizon in enumerate(rolled["horizons"]):
            before, after = (side and side["rms"] for side in (horizon["before"], horizon["after"]))
            name, *errors = _joint_row(rolled, j, before, after, horizon["removed"])
            starts = Num(str(horizon["starts"]))
            rows.append(["" if k else name, value(horizon["seconds"], 2), *errors, starts])
    said = f"From measured states the model is let go under the logged torques, {blocks(rolled)}."
    head = ["joint", "ahead [s]", *_errors_heads(rolled["horizons"][0]["after"]), "starts"]
    return {"said": tidy(" ".join([said, *more])), "head": head, "rows": rows}


def _commanded(rolled: Values, loop: Values) -> dict[str, Any]:
    joints, ran = range(len(rolled["joints"])), loop["blocks"]
    note = "rms over the blocks under their logged commands"
    for which, word in (("before", "given"), ("after", "extended")):
        if gone := lost(ran, which):
            note += f"; of the {word} model {gone} of {len(ran)} blocks diverged and are left out"
    rows = [_joint_row(rolled, j, loop["before"], loop["after"], loop["removed"]) for j in joints]
    return {"head": ["joint", *_errors_heads(loop["after"])], "rows": rows, "note": note}


def _errors_heads(after: Any) -> list[str]:
    return ["error"] if after is None else ["before", "after", "removed"]


def _joint_row(rolled: Values, j: int, before: Any, after: Any, removed: Any) -> list[Entry]:
    """Make the cells of a joint: name, errors and, if causes are named, the share of error that they remove."""
    unit, scale = shown_units(rolled)[rolled["units"][j]]
    sides = [side and side[j] for side in ([before] if after is None else [before, after])]
    errors = [value(None if side is None else scale * side, 3) for side in sides]
    share = [] if after is None else [Num(percent(removed and removed[j]))]
    return [f"{rolled['joints'][j]} [{spelled_text(unit)}]", *errors, *share]


def _limits(limits: Sequence[Values]) -> Rows:
    """Tabulate smallest and largest detection limit over the places, per cause and parameter."""
    sizes: dict[tuple[str, str], list[float | None]] = {}
    kinds = {entry["cause"]: kind_of(entry) for entry in limits}
    for entry in limits:
        for name, limit in entry["parameters"].items():
            sizes.setdefault((entry["cause"], name), []).append(limit)
    every = [(parameter(name)[1], limit) for (_, name), found in sizes.items() for limit in found]
    shown = one_each((unit, limit) for unit, limit in every if limit is not None)
    rows: Rows = []
    last = ""
    for (cause, name), found in sizes.items():
        words, unit = parameter(name)
        unit, scale = shown.get(unit, (unit, 1.0))
        seen = sorted(scale * limit for limit in found if limit is not None)
        sizes_said = Num("never")
        where = f"nowhere: these recordings say nothing ({len(found)} places)"
        if seen:
            low, high = plain(seen[0], 2), plain(seen[-1], 2)
            sizes_said = Num(low if low == high else f"{low} to {high}", unit=spelled(unit))
            where = f"{len(seen)} of {len(found)}" if len(seen) < len(found) else "everywhere"
        rows.append([cause_name(kinds[cause], cause) if cause != last else "", words, sizes_said, where])
        last = cause
    return rows


def _models(folder: Path) -> dict[str, Any] | None:
    """List the folders with models beside the diagnosis, and their files."""
    there = {name: files for name in (EXTENDED, AS_FOUND) if (files := _files(folder / name))}
    if not there:
        return None
    every = [path for files in there.values() for path in files]
    code = Markup("<code>{}</code>")
    return {
        "extended": EXTENDED in there, "as_found": AS_FOUND in there,
        "of_a_team": any(path.name == "team.xml" for path in there.get(EXTENDED, [])),
        "rows": [[code.format(p.relative_to(folder).as_posix()), Num(size(p.stat().st_size))] for p in every],
    }  # fmt: skip


def _files(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.rglob("*") if path.is_file() and path.name != LIST)
    except OSError:
        return []


def _pictures(result: Result) -> tuple[list[tuple[str, Callable[[], Any]]], str]:
    """Request a picture of the causes in the first recording that still exists, or say why there is none."""
    estimates = (result.found.values["gain"] or {}).get("estimates")
    if not estimates:
        return [], ""
    causes, said = read_diagnosis(result.path.parent).causes, []
    for source in sources(result):
        try:
            recording = source.recording()
        except InputError as error:
            said.append(str(error))
            continue
        made = partial(diagnosis_shot, recording, _grasped(estimates["after"]), causes)
        return [("Where the causes sit" if causes else "The team", made)], ""
    return [], f"It needs one of the recordings: {'; '.join(said)}." if said else ""


def _grasped(values: Values) -> PayloadEstimate:
    """Build an estimate with the grasps of a diagnosis only, which suffices for a picture."""
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
