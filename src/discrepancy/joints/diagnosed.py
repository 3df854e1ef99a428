"""A verdict on joint logs as JSON values with words, as text and as a result folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from discrepancy.evidence.findings import Finding, words_of
from discrepancy.joints.causes import LINKS, WORDS, Said, joint_in_words, link_in_words, titled
from discrepancy.joints.effects import all_effects, numbered
from discrepancy.joints.model import SerialModel
from discrepancy.joints.verdict import JointVerdict, Prediction
from discrepancy.numbers import three_digits
from discrepancy.result.folder import Diagnosed
from discrepancy.result.json import ALL, Told, Values
from discrepancy.result.read import EXTENDED
from discrepancy.result.remains import excess_removed
from discrepancy.result.traces import Channel
from estimator.arrays import Array
from mocobot_sim.model_check import check_named
from mocobot_sim.serial.extended import write_extended as write_model


def verdict_to_dict(verdict: JointVerdict, rollouts: Mapping[str, Any] | None = None) -> Values:
    """Convert the verdict to plain JSON values.

    Args:
        verdict: the verdict.
        rollouts: result of ``rolled.rolled_out``, or None.
    """
    return JointValues(verdict).values(_gain(verdict), rollouts=rollouts)


class JointValues(Told):
    """Converts a verdict on joint logs to JSON values with words."""

    machine = "joints"
    verdict: JointVerdict

    def __init__(self, verdict: JointVerdict) -> None:
        super().__init__(verdict)
        self.model = verdict.model
        turned = (f.shape["turned_deg"] for f in verdict.findings if "turned_deg" in f.shape)
        self.turned_deg: float = next(turned, 0.0)
        self.than = "than in the reference" if verdict.reference else "than modelled"

    def at(self, cause: str, place: str, joint: int | None, partner: int | None = None) -> Values:
        """Cause and place as JSON values and in words."""
        title = WORDS[cause].title if cause in WORDS else cause.replace("_", " ")
        if cause == "gravity_direction" and self.turned_deg:
            title = f"mount turned by {self.turned_deg:.0f} deg"
        if "{pair}" in title and joint is not None and partner is None:
            partner = joint - 1  # a drive is shared with the joint before
        where = self.where(cause, place, joint, partner)
        return {"cause": cause, "kind": titled(title), "name": titled(title, where), "family": cause, "robot": None,
                "joint": joint, "place": where}  # fmt: skip

    def where(self, cause: str, place: str, joint: int | None, partner: int | None = None) -> str:
        """A place in words."""
        if joint is not None and partner is not None:
            return f"joints {min(joint, partner)} and {max(joint, partner)}"
        if cause in LINKS:
            return place if place.startswith("all ") else link_in_words(place)
        if joint is None and place in self.model.joints:
            joint = self.model.joints.index(place) + 1
        return place if joint is None else joint_in_words(joint, self.model.joints[joint - 1])

    def finding(self, f: Finding) -> Values:
        return super().finding(f) | words_of(f, self.where(f.cause, f.place, f.joint))

    def sentence(self, f: Finding, place: str, parameters: Mapping[str, Mapping[str, Any]]) -> str:
        """Sentence on the effect of a finding with its values; for several members, with their medians."""
        if f.law is not None:
            what = "position reading" if f.law.place == "joint position" else "torque"
            return f"{f.law.sentence(f'The {what} of {place}')}."
        numbers = {name: entry["value"] for name, entry in parameters.items()}
        errors = {name: entry["se"] for name, entry in parameters.items() if entry["se"] is not None}
        when = {"start_s": f.event.start_s, "duration_s": f.event.duration_s} if f.event else {}
        slides = [
            bool(self.model.slides[member.joint - 1]) for member in f.members if member.joint is not None
        ]
        if len(slides) > 1:
            mixed = len({tuple(member.values) for member in f.members}) > 1  # slides have other units
            count = slides.count(False) if mixed else len(slides)
            place = f"the typical joint{' that turns' if mixed else ''} (median of {count})"
        said = Said({**numbers, **f.shape, **when}, errors, place, bool(slides) and all(slides), self.than)
        cause = WORDS.get(f.cause)
        if cause is None or cause.sentence is None:
            listed = ", ".join(f"{name} {value:.3g}" for name, value in numbers.items())
            text = f"{titled(cause.title if cause else f.cause, place)}: {listed}"
        else:
            text = cause.sentence(said)
        if cause and len(slides) > 1:
            text = f"{titled(cause.title, ALL)}: {text}"
        if f.of:
            text = f"{text} and goes with its {f.of}"
        trials = (*self.verdict.trials, *self.verdict.reference)
        trial = f" in {trials[f.event.trial]}" if f.event and len(trials) > 1 else ""
        return f"{text[:1].upper()}{text[1:]}{trial}."

    def separate(self, cause: str) -> str:
        return WORDS[cause].separate if cause in WORDS else ""

    def signature(self, which: str) -> Values:
        return _signature(self.verdict, which)


def _gain(verdict: JointVerdict) -> Values | None:
    """Prediction errors without and with the findings, as JSON values."""
    if not verdict.predictions:
        return None
    predictions, known = verdict.predictions, _known(verdict)
    names = {j: f"{verdict.model.joints[j]} torque" for j in known}

    def errors(one: Prediction, which: str) -> dict[str, float]:
        rms = getattr(one, which)
        sizes = {f"{name}_rms": float(rms[j]) for j, name in names.items()}
        sizes |= {f"{name}_nrmse": float(rms[j] / one.torque[j]) for j, name in names.items()}
        return sizes | {"chi2_per_n": float(getattr(one, f"chi2_{which}"))}

    sides = {which: [errors(one, which) for one in predictions] for which in ("before", "after")}
    both = zip(predictions, sides["before"], sides["after"], strict=True)
    noise = np.sqrt(np.mean([np.square(one.noise) for one in predictions], axis=0))
    return {
        "held_out": {which: _means(each) for which, each in sides.items()} | {"as_found": None},
        "units": {name: unit_of(verdict.model, j) for j, name in names.items()},
        "noise": {f"{name}_rms": float(noise[j]) for j, name in names.items()},
        "removed": excess_removed((one.chi2_before, one.chi2_after) for one in predictions)
        if verdict.findings
        else None,
        "validated": verdict.validated,
        "trials": [{"name": one.trial, "before": before, "after": after} for one, before, after in both],
    }


def unit_of(model: SerialModel, joint: int) -> str:
    """Unit of a joint's torque; joints count from 0."""
    return "N" if model.slides[joint] else "N m"


def _known(verdict: JointVerdict) -> list[int]:
    """Indices of the joints whose torques were predicted in all trials."""
    sizes = np.array([[f.before, f.after, f.noise, f.torque] for f in verdict.predictions])
    there = np.isfinite(sizes).all(axis=(0, 1)) & (sizes[:, 2:] > 0.0).all(axis=(0, 1))
    return [int(j) for j in np.flatnonzero(there)]


def _means(each: Sequence[Mapping[str, float]]) -> dict[str, float]:
    return {key: float(np.mean([one[key] for one in each])) for key in each[0]}


def _signature(verdict: JointVerdict, which: str) -> Values:
    """Distribution of the misfit by joint and trial, ``before`` or ``after`` the findings."""
    known, joints = _known(verdict) if verdict.predictions else [], verdict.model.joints
    squares: list[Array] = [
        np.square(getattr(f, which) / np.where(f.noise > 0, f.noise, 1.0)) for f in verdict.predictions
    ]
    channel = {j: float(np.mean([square[j] for square in squares])) for j in known}
    worst = max(known, key=lambda j: channel[j], default=None)
    said = "No torque was predicted."
    if worst is not None:
        place = joint_in_words(worst + 1, joints[worst])
        said = f"The torque of {place} is off most, by chi2/n {three_digits(channel[worst])}."
    return {
        "chi2_per_n": verdict.chi2_per_n[0 if which == "before" else 2],
        "kind": {},
        "channel": {f"{joints[j]} torque": size for j, size in channel.items()},
        "trial": {f.trial: float(getattr(f, f"chi2_{which}")) for f in verdict.predictions},
        "sentence": said,
    }


@dataclass(frozen=True, eq=False)
class JointDiagnosed(Diagnosed[JointVerdict]):
    """A verdict with the results of rollouts.

    Attributes:
        verdict: the verdict.
        rollouts: plain JSON values, or None.
    """

    verdict: JointVerdict
    rollouts: Mapping[str, Any] | None = None

    @cached_property
    def values(self) -> Values:
        return verdict_to_dict(self.verdict, self.rollouts)

    def models(self) -> Iterator[tuple[str, str, Callable[[Path], None]]]:
        if self.verdict.findings:
            yield EXTENDED, "extended model", lambda folder: write_extended(self.verdict, folder)

    @property
    def channels(self) -> Sequence[Channel]:
        model = self.verdict.model
        known = [(j, model.joints[j]) for j in self.verdict.measured]
        return [Channel(f"{name} torque", "torque", None, unit_of(model, j)) for j, name in known]

    def unit(self, name: str) -> str:
        of_position = name.removeprefix("position of joint ")
        if of_position.isdigit():
            return "m" if self.verdict.model.slides[int(of_position) - 1] else "rad"
        return "typical speeds" if name == "speed" else "N m"


def write_extended(verdict: JointVerdict, folder: Path) -> None:
    """Write the extended model, which contains the findings, into a new folder.

    Raises:
        InputError: the folder cannot be written, MuJoCo refuses the model, or it refers to files outside its folder.
    """
    effects = numbered((effect for _, effect in all_effects(verdict.findings, verdict.model)), verdict.model)
    spec = verdict.model.source.copy()
    check_named(verdict.model.path, assets=False)
    notes = verdict.model.notes
    write_model(spec, effects, folder, verdict.trials, reference=bool(verdict.reference), notes=notes)
