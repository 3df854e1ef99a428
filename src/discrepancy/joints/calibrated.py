"""A calibration of a robot from joint logs as text, JSON values, a table and a model.

Keys of ``calibration.json``:

format, version     "mocobot-joint-calibration", 1
model               path of the given model
logs                names of the logs
parameters          list of {place, parameter, model, value, se, prior_se, determined, in_model}; units are in the
                    names, ``in_model`` is false for errors of the log, ``prior_se`` is the error before the logs
combinations        list of {terms, model, value, se}: what the logs determine where they do not determine each
                    parameter; terms are lists of {place, parameter, factor}, inertial ones about the link's frame
predicts            torque, or position where commands alone tell the drives
held_out            {joint: {model, least_squares, calibrated, noise, torque}}: rms of what predictions from other parts
                    leave, of the noise and of the torque [N m or N]. For positions: of forecasts over one second from
                    commands alone, of the readings' noise, and standard deviation of the position [rad or m];
                    least_squares is null
forecasts           of positions only: {part, time_s, joints: {joint: {command, measured, model, calibrated,
                    response}}}: positions in the middle of the first part [rad or m], simulated ones in windows of one
                    second; response {frequency_Hz, measured, model, calibrated}: amplitude of the position over that
                    of the command
validated           false if the only part was predicted from itself
same                list of {names, probability, differences}: two machines of one kind, the probability that equal ones
                    differ as much, and a list of {places, parameter, values, se}: se is that of the difference
notes               sentences
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np

from discrepancy.joints import actuators
from discrepancy.joints.calibration import ArmCalibration, Combination, HeldOut, Parameter
from discrepancy.joints.causes import WORDS as CAUSES
from discrepancy.joints.causes import joint_in_words, link_in_words, titled
from discrepancy.joints.effects import numbered
from discrepancy.joints.forecast import RESPONSE, SERIES, Forecasts
from discrepancy.joints.problem import MOMENTS
from discrepancy.joints.quantities import UNITS, WORDS, described
from discrepancy.joints.same_kind import Comparison, Difference
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.files import write_json, write_text
from estimator.statistics import measured, rms
from estimator.strict import Fields, is_number
from mocobot_logs.joints.joint_log import Drive
from mocobot_sim.model_check import check_named
from mocobot_sim.serial.effects import RobotEffect
from mocobot_sim.serial.extended import put, take_along
from mocobot_sim.serial.mjcf import keep_inertials, real_inertia, servo, set_inertial, with_effects

FORMAT, VERSION = "mocobot-joint-calibration", 1
MODEL, TABLE, NAME, REPORT = "as_found.xml", "parameters.csv", "calibration.json", "report.txt"
KEYS = "format", "version", "model", "logs", "parameters", "combinations", "held_out", "validated", "notes"
OPTIONAL = "provenance", "predicts", "forecasts", "same"
COMPARISON, DIFFERENCE = ("names", "probability", "differences"), ("places", "parameter", "values", "se")
PARAMETER = ("place", "parameter", "model", "value", "se", "prior_se", "determined", "in_model")
HELD_OUT = ("model", "least_squares", "calibrated", "noise", "torque")
QUANTITY = {"parameter": (
    "a quantity with its unit, such as coulomb_Nm", lambda name: name == "gain" or (isinstance(name, str)
    and name.partition("_")[0] in WORDS and name.endswith(tuple(f"_{unit}" for unit in UNITS))),
)}  # fmt: skip
WIDTH, LABEL, MOST_LABEL = 100, 52, 64
"""Width of the text, least and most of labels of rows."""
COMBINED = "Determined in combination only"
Quantity = tuple[str, str, str, float, float, float]
"""Title of its kind, words, unit, given and found value, standard error."""
MISFIT = 2.0
"""Ratio of predicted residual and noise beyond which the model lacks something. Chosen."""
MOST_TERMS, MOST_COMBINATIONS, MOST_ROWS, ROUND = 6, 12, 30, 1e-3
"""Terms of a combination, combinations and parameters that the text shows, and the rounding of a factor of 1."""


def to_dict(found: ArmCalibration) -> dict[str, Any]:
    """Plain JSON values; the module's docstring lists the keys."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "model": str(found.model.path),
        "logs": list(found.logs),
        "parameters": [
            {
                "place": p.place, "parameter": p.name, "model": p.model, "value": p.value, "se": p.se,
                "prior_se": p.prior, "determined": p.determined, "in_model": p.in_model,
            }
            for p in found.parameters
        ],
        "combinations": [
            {
                "terms": [{"place": k[0], "parameter": k[1], "factor": x} for k, x in c.terms.items()],
                "model": c.model, "value": c.value, "se": c.se,
            }
            for c in found.combinations
        ],
        "predicts": found.predicts,
        "held_out": {
            found.model.joints[j]: {n: None if np.isnan(x := _mean(found.held_out, n, j)) else x for n in HELD_OUT}
            for j in found.joints
        },
        **({} if found.forecasts is None else {"forecasts": _forecasts(found, found.forecasts)}),
        **({} if not found.same else {"same": [
            {"names": list(one.names), "probability": one.probability, "differences": [
                {"places": list(d.places), "parameter": d.name, "values": list(d.values), "se": d.se}
                for d in one.differences
            ]}
            for one in found.same
        ]}),
        "validated": found.validated,
        "notes": list(found.notes),
    }  # fmt: skip


def _forecasts(found: ArmCalibration, of: Forecasts) -> dict[str, Any]:
    def lists(names: Sequence[str], table: Array) -> dict[str, Any]:
        return {
            n: [None if np.isnan(x) else round(float(x), 7) for x in own]
            for n, own in zip(names, table.T, strict=True)
        }

    joints = {
        found.model.joints[j]: lists(SERIES, of.positions[j]) | {"response": lists(RESPONSE, of.responses[j])}
        for j in found.joints
    }
    return {"part": of.part, **lists(["time_s"], of.time[:, None]), "joints": joints}


def _mean(held: Sequence[HeldOut], name: str, joint: int) -> float:
    """Root mean square over the parts."""
    return rms([getattr(one, name)[joint] for one in held])


def to_text(found: ArmCalibration) -> str:
    """Report: the gain on held-out data, what the logs determine, and what they do not."""
    lines = ([line] if line[:1] in ("", " ") else textwrap.wrap(line, WIDTH) for line in _lines(found))
    return "\n".join(part for wrapped in lines for part in wrapped)


def gain(found: ArmCalibration) -> str:
    """Sentence on what the model predicts of data that it was not fitted to."""
    shares = {n: _share(found, n) for n in HELD_OUT[:4]}
    if found.predicts == "position":
        whose = "logs that were not fitted" if found.validated else "the log that was fitted (one part only)"
        return (
            f"Forecasts of one second from commands alone err by {_percent(shares['calibrated'])} of the motion with "
            f"the calibrated model and by {_percent(shares['model'])} with the given one, in {whose}. The readings' "
            f"noise is about {_percent(shares['noise'])}."
        )
    which = (
        "torques of parts that were not fitted"
        if found.validated
        else "the torques it was fitted to (one part only)"
    )
    return (
        f"The calibrated model leaves {_percent(shares['calibrated'])} of {which}; the given model leaves "
        f"{_percent(shares['model'])}, ordinary least squares of the same parameters "
        f"{_percent(shares['least_squares'])}. Sensor noise is about {_percent(shares['noise'])}."
    )


def _lines(found: ArmCalibration) -> Iterator[str]:
    yield gain(found)
    told = sum(p.determined for p in found.parameters)
    count = len(found.combinations)
    both = f" and {count} combination{'s' if count > 1 else ''} of others" if count else ""
    yield f"The logs determine {told} of {len(found.parameters)} parameters{both}."
    yield from findings(found)
    yield ""
    yield from _left(found)
    shown = [p for p in found.parameters if p.determined]
    width = min(max([LABEL, *(len(_label(found, p)) for p in shown)]), MOST_LABEL)
    for title, wanted in (
        ("Determined, in the model (clearest change first)", True),
        ("Determined, of the log", False),
    ):
        own = [p for p in shown if p.in_model == wanted]
        own.sort(key=lambda p: -abs(p.value - p.model) / p.se)
        if own:
            yield ""
            yield f" {title:<{width + 1}}{'given':>10}   found"
        for p in own[:MOST_ROWS]:
            scale = described(p.name)[2]
            yield from _row(_label(found, p), scale * p.model, scale * p.value, scale * p.se, width)
        if len(own) > MOST_ROWS:
            yield f"  {len(own) - MOST_ROWS} more are in {TABLE}."
    if found.combinations:
        yield ""
        yield f" {COMBINED:<{width + 1}}{'given':>10}   found"
        for c in found.combinations[:MOST_COMBINATIONS]:
            yield from _row(_formula(c), c.model, c.value, c.se, width)
        if len(found.combinations) > MOST_COMBINATIONS:
            yield f"  {len(found.combinations) - MOST_COMBINATIONS} more are in {NAME}."
    for comparison in found.same:
        yield from ("", *comparison.lines())
    unknown = [p for p in found.parameters if not p.determined]
    if unknown:
        yield ""
        yield f"Not determined by these logs, so near the given values ({MODEL} holds the likeliest ones):"
        for line in _unknown(found, unknown):
            yield from textwrap.wrap(line, WIDTH, initial_indent="  ", subsequent_indent="    ")
        yield "Faster motion in more poses determines more; a known weight determines the common factor of all torques."
    if found.notes:
        yield ""
        yield from found.notes


def _left(found: ArmCalibration) -> Iterator[str]:
    """Table of what predictions leave."""
    names = ("torque", *(n for n in HELD_OUT[:4] if n != "least_squares" or found.predicts == "torque"))
    what, first = (
        ("rms torque", "measured") if found.predicts == "torque" else ("rms error over 1 s", "motion")
    )
    heads = {"torque": first, "model": "model", "least_squares": "least sq."}
    rows = {j: f"{found.model.joints[j]} [{unit_of(found, j)}]" for j in found.joints}
    width = min(max([24, *map(len, rows.values())]), WIDTH - 1 - 12 * len(names))
    yield f" {what:<{width}}" + "".join(f"{heads.get(n, n):>12}" for n in names)
    for j, row in rows.items():
        cells = "".join(f"{scale_of(found) * _mean(found.held_out, n, j):>12.3g}" for n in names)
        yield f" {row:<{width}.{width}}{cells}"


def scale_of(found: ArmCalibration) -> float:
    """Factor from SI units to those of ``unit_of``."""
    return 1e3 if found.predicts == "position" else 1.0


def unit_of(found: ArmCalibration, joint: int) -> str:
    """Unit of what the table of predictions shows of a joint: N m, N, mrad or mm."""
    units = ("N m", "N") if found.predicts == "torque" else ("mrad", "mm")
    return units[int(found.model.slides[joint])]


def findings(found: ArmCalibration) -> tuple[str, ...]:
    """Sentences on what casts doubt on the numbers."""
    out = []
    share = {n: _share(found, n) for n in HELD_OUT[:4]}
    if share["calibrated"] > share["model"]:
        out.append(
            "It predicts worse than the given model: do not use it. Longer logs in more poses may mend that."
        )
    if found.predicts == "position" and share["calibrated"] > 1.0:
        out.append(
            "It does not follow the motion at all; `mocobot inspect` looks for wrong signs and exchanged joints."
        )
    if found.predicts == "torque" and share["calibrated"] > MISFIT * share["noise"]:
        out.append(
            "Much more than noise is left, so something else acts, too; `mocobot diagnose` looks for it."
        )
    return tuple(out)


def _share(found: ArmCalibration, name: str) -> float:
    """Torque left over torque, root mean square over joints and parts."""
    return rms(
        [
            _mean(found.held_out, name, j) / max(_mean(found.held_out, "torque", j), 1e-12)
            for j in found.joints
        ]
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"


def _label(found: ArmCalibration, p: Parameter) -> str:
    what, unit, _ = described(p.name)
    return f"{what} of {place_in_words(found, p.place)} [{unit}]"


def _row(label: str, given: float, value: float, se: float, width: int) -> Iterator[str]:
    """A line of a table, below its label if that is longer than ``width``."""
    if len(label) > width:
        yield from textwrap.wrap(label, WIDTH, initial_indent="  ", subsequent_indent="    ")
        label = ""
    found, error = measured(value, se)
    yield f"  {label:<{width}}{given:>10.4g}   {found} +- {error}"


def place_in_words(found: ArmCalibration, place: str) -> str:
    """A joint, a link or the base in words."""
    joints = found.model.joints
    if place in joints:
        return joint_in_words(joints.index(place) + 1, place)
    return place if place == "base" else link_in_words(place)


def _formula(c: Combination) -> str:
    """The terms of a combination; those with equal factors and quantities share one."""
    alike: dict[tuple[str, str], list[str]] = {}
    for (place, name), factor in c.terms.items():
        size = "" if abs(abs(factor) - 1.0) < ROUND else f"{abs(factor):.3g} "
        alike.setdefault((f"{'-' if factor < 0 else '+'} {size}", name), []).append(place)
    terms = [f"{size}{name}({', '.join(places)})" for (size, name), places in alike.items()]
    more = f" + {len(terms) - MOST_TERMS} more" if len(terms) > MOST_TERMS else ""
    return " ".join(terms[:MOST_TERMS]).removeprefix("+ ") + more


def _unknown(found: ArmCalibration, parameters: Sequence[Parameter]) -> Iterator[str]:
    by_place: dict[str, list[str]] = {}
    for p in parameters:
        what = described(p.name)[0]
        stem = next(
            (w for w in ("centre of mass", "inertia", "tilt", "frame position") if what.startswith(w)), what
        )
        own = by_place.setdefault(p.place, [])
        if stem not in own:
            own.append(stem)
    alike: dict[tuple[str, ...], list[str]] = {}
    for place, names in by_place.items():
        alike.setdefault(tuple(names), []).append(place_in_words(found, place))
    for names, places in alike.items():
        yield f"{', '.join(places)}: {', '.join(names)}"


def effects_of(found: ArmCalibration) -> list[RobotEffect]:
    """What MJCF holds beside inertial parameters, as changes of the given model."""
    joints, out = found.model.joints, []
    for p in found.parameters:
        if not p.in_model or p.place not in joints:
            continue
        j, change = joints.index(p.place) + 1, p.value - p.model
        if p.name.startswith("coulomb_"):
            viscous = next(
                q for q in found.parameters if q.place == p.place and q.name.startswith("viscous_")
            )
            numbers = {p.name: change, viscous.name: max(viscous.value, 0.0) - viscous.model}
            if (law := found.friction.get(j - 1)) is not None:
                numbers = {p.name: law[0] - p.model, viscous.name: max(law[1], 0.0) - viscous.model}
                numbers |= {"quadratic": law[2], "cubic": law[3]}
            out.append(RobotEffect("friction", j, None, numbers, ""))
        elif p.name.startswith("armature_"):
            out.append(RobotEffect("armature", j, None, {p.name: change}, ""))
        elif p.name.startswith("zero_"):
            out.append(RobotEffect("joint_zero", j, None, {p.name: change}, ""))
        elif p.name.startswith("position_"):
            moved = dict.fromkeys(("x_m", "y_m", "z_m"), 0.0) | {p.name.removeprefix("position_"): change}
            out.append(RobotEffect("link_length", j, None, moved, ""))
    for j, (coulomb, viscous, rotor, ratio) in found.coupled.items():
        numbers = {
            "coulomb_Nm": coulomb,
            "viscous_Nms_per_rad": viscous,
            "armature_kgm2": rotor,
            "ratio": ratio,
        }
        out.append(RobotEffect("coupled_drive", j + 1, j, numbers, ""))
    gravity = {f"{axis}_m_per_s2": float(g) for axis, g in zip("xyz", found.gravity, strict=True)}
    return [*out, RobotEffect("gravity_direction", None, None, gravity, "")]


def as_found(found: ArmCalibration) -> tuple[mujoco.MjSpec, list[str]]:
    """The given model with the found numbers, and a sentence on each effect that it cannot hold.

    Raises:
        InputError: MuJoCo refuses it.
    """
    spec = found.model.source.copy()
    keep_inertials(spec, spec.compile())
    for b in found.links:
        body = spec.body(found.model.model.body(b).name)
        set_inertial(body, float(found.tree.mass[b]), found.tree.com[b], real_inertia(found.tree.inertia[b]))
    for name, loop in zip(found.model.joints, () if found.servos is None else found.servos, strict=False):
        servo(spec, name, *map(float, loop))
    effects = effects_of(found)
    inside = with_effects(spec, numbered(effects, found.model))[1]
    joints = found.model.joints
    return spec, [
        f"{MODEL} leaves {titled(CAUSES[e.cause].title, joint_in_words(e.joint, joints[e.joint - 1]))} as given: MJCF "
        f"cannot hold what {TABLE} has"
        for e, held in zip(effects, inside, strict=True)
        if e.joint and not held
    ]


def write_as_found(found: ArmCalibration, folder: Path) -> list[str]:
    """Write ``as_found.xml`` and the files that it refers to into an existing folder; return what it cannot hold.

    Raises:
        InputError: MuJoCo refuses the model, it refers to files outside its folder, or a file cannot be written.
    """
    check_named(found.model.path, assets=False)
    spec, as_given = as_found(found)
    taken = take_along(spec)
    try:
        put(taken, spec, folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from error
    write_text(folder / MODEL, spec.to_xml())
    mujoco.MjModel.from_xml_path(str(folder / MODEL))
    return as_given


def write_into(found: ArmCalibration, folder: Path, drives: Sequence[Drive] = (), **more: Any) -> list[str]:
    """Write JSON, text, table and model into an existing folder, and the actuators if ``drives`` are given.

    Returns what the model cannot hold.

    Raises:
        InputError: a file cannot be written, or MuJoCo refuses the model.
    """
    as_given = write_as_found(found, folder)
    found = replace(found, notes=(*found.notes, *(f"{said}." for said in as_given)))
    head = "place,parameter,model,found,se,determined"
    rows = [
        f"{_cell(p.place)},{p.name},{p.model:.9g},{p.value:.9g},{p.se:.3g},{'yes' if p.determined else 'no'}"
        for p in found.parameters
    ]
    write_text(folder / TABLE, "\n".join([head, *rows]) + "\n")
    write_json(folder / NAME, to_dict(found) | more)
    write_text(folder / REPORT, to_text(found) + "\n")
    if drives:
        actuators.write(found, drives, folder)
    return as_given


def _cell(text: str) -> str:
    """A cell of a CSV table."""
    quoted = text.replace('"', '""')
    return f'"{quoted}"' if set(text) & set(',"\n') else text


@dataclass(frozen=True, eq=False)
class Told:
    """A calibration as its JSON has it: attributes of ``ArmCalibration``; ``model`` has path, joints and slides."""

    model: Any
    joints: tuple[int, ...]
    parameters: tuple[Parameter, ...]
    combinations: tuple[Combination, ...]
    held_out: tuple[HeldOut, ...]
    validated: bool
    logs: tuple[str, ...]
    notes: tuple[str, ...]
    predicts: str
    forecasts: Forecasts | None = None
    same: tuple[Comparison, ...] = ()

    @property
    def found(self) -> ArmCalibration:
        """The same for the functions of this module that make text and JSON, which need no more."""
        return cast(ArmCalibration, self)

    @property
    def unknown(self) -> list[str]:
        """What is not determined, a line for places with the same quantities."""
        return list(_unknown(self.found, [p for p in self.parameters if not p.determined]))

    @property
    def determined(self) -> dict[frozenset[tuple[tuple[str, str], float]], Quantity]:
        """Determined parameters and combinations by their terms, with factors to a thousandth."""
        out = {}
        for p in (p for p in self.parameters if p.determined):
            what, unit, x = described(p.name)
            kind = f"Determined, {'in the model' if p.in_model else 'of the log'}"
            words, terms = f"{what} of {place_in_words(self.found, p.place)}", [((p.place, p.name), 1.0)]
            out[frozenset(terms)] = kind, words, unit, x * p.model, x * p.value, x * p.se
        for c in self.combinations:
            name, units = next(iter(c.terms))[1], {"m": "kg"} | dict.fromkeys(("mx", "my", "mz"), "kg m")
            unit = described(name)[1] if "_" in name else units.get(name, "kg m^2")
            terms = frozenset((k, round(x, 3)) for k, x in c.terms.items() if abs(x) > ROUND)
            out[terms] = COMBINED, _formula(c), unit, c.model, c.value, c.se
        return out

    @property
    def names(self) -> list[str]:
        """Name and unit of every joint with torque."""
        return [f"{self.model.joints[j]} [{unit_of(self.found, j)}]" for j in self.joints]

    def rms(self, name: str) -> Array:
        """Return an attribute of ``HeldOut`` of the joints with torque, in the units of ``names``, shape (K,)."""
        return scale_of(self.found) * getattr(self.held_out[0], name)[list(self.joints)]


def from_dict(values: Mapping[str, Any], where: str) -> Told:
    """Read the values of ``to_dict``, with or without provenance; ``where`` is the file's name in messages.

    Raises:
        InputError: a value is missing, invalid or unknown.
    """
    file = Fields(values, KEYS, where, OPTIONAL)
    file.check({"version": (str(VERSION), lambda version: version == VERSION)})
    parameters = tuple(map(_parameter, file.objects("parameters", PARAMETER)))
    held, predicts = file.object("held_out"), values.get("predicts", "torque")
    if predicts not in ("torque", "position"):
        file.refuse("predicts", "torque or position")
    # Zeros are those of all joints but the first, which has friction if it has torque.
    zeros = [p.place for p in parameters if p.name.startswith("zero_")]
    joints = (next((joint for joint in held if joint not in zeros), ""), *zeros)
    if not held or set(held) - set(joints):
        file.refuse("held_out", "an object with the torques of joints that are in parameters")
    known, table = tuple(j for j, joint in enumerate(joints) if joint in held), np.zeros((5, len(joints)))
    for j in known:
        sizes = Fields(held[joints[j]], HELD_OUT, f"{where}: held_out: {joints[j]}")
        table[:, j] = [
            np.nan if name == "least_squares" and predicts == "position" else sizes.number(name, 0.0)
            for name in HELD_OUT
        ]
    slides = [any((p.place, p.name) == (joint, "coulomb_N") for p in parameters) for joint in joints]
    combinations = tuple(map(_combination, file.objects("combinations", ("terms", *PARAMETER[2:5]))))
    return Told(
        SimpleNamespace(path=Path(file.words("model")), joints=joints, slides=slides), known, parameters, combinations,
        (HeldOut("", *table),), file.flag("validated"), file.texts("logs"), file.texts("notes"), predicts,
        _read_forecasts(file, [joints[j] for j in known], known) if "forecasts" in file else None,
        tuple(map(_comparison, file.objects("same", COMPARISON))) if "same" in file else (),
    )  # fmt: skip


def _read_forecasts(file: Fields, names: Sequence[str], known: Sequence[int]) -> Forecasts:
    one = file.within("forecasts", ("part", "time_s", "joints"))
    each = one.within("joints", names)

    def columns(fields: Fields, keys: Sequence[str], length: int) -> Array:
        for key in keys:
            if not all(x is None or is_number(x) for x in fields.list(key, length)):
                fields.refuse(key, "a list of finite numbers and null")
        return np.array([fields.values[key] for key in keys], dtype=float).T

    time = columns(one, ["time_s"], len(one.list("time_s")))[:, 0]
    positions, responses = {}, {}
    for j, name in zip(known, names, strict=True):
        own = each.within(name, (*SERIES, "response"))
        positions[j], inner = columns(own, SERIES, len(time)), own.within("response", RESPONSE)
        responses[j] = columns(inner, RESPONSE, len(inner.list("frequency_Hz")))
    return Forecasts(one.words("part"), time, positions, responses)


def _comparison(one: Fields) -> Comparison:
    differences = []
    for own in one.objects("differences", DIFFERENCE):
        own.check(QUANTITY)
        places, values = own.texts("places"), own.array("values", (2,))
        if len(places) != 2:
            own.refuse("places", "two joints or links")
        pair, both = (places[0], places[1]), (float(values[0]), float(values[1]))
        differences.append(Difference(pair, own.text("parameter"), both, own.number("se", above=0.0)))
    names = one.texts("names")
    if len(names) != 2:
        one.refuse("names", "two texts")
    return Comparison((names[0], names[1]), tuple(differences), one.number("probability", 0.0))


def _parameter(one: Fields) -> Parameter:
    one.check(QUANTITY)
    se, prior = (one.number(key, above=0.0) for key in ("se", "prior_se"))
    model, value, place, name = (
        one.number("model"),
        one.number("value"),
        one.words("place"),
        one.text("parameter"),
    )
    return Parameter(place, name, model, value, se, prior, one.flag("determined"), one.flag("in_model"))


def _combination(one: Fields) -> Combination:
    factors = {}
    for term in one.objects("terms", ("place", "parameter", "factor")):
        if term.text("parameter") not in MOMENTS:
            term.check(QUANTITY)
        factors[term.words("place"), term.text("parameter")] = term.number("factor")
    if not factors:
        one.refuse("terms", "a list of at least one term")
    return Combination(factors, one.number("model"), one.number("value"), one.number("se", above=0.0))
