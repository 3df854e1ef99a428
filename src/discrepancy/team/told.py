"""Report a verdict on a team: JSON values with sentences, and models for the result folder."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.evidence.findings import Finding, words_of
from discrepancy.numbers import Numbers, three_digits
from discrepancy.result.folder import Diagnosed
from discrepancy.result.json import Told, Values
from discrepancy.result.read import AS_FOUND, EXTENDED
from discrepancy.result.remains import excess_removed, of_response
from discrepancy.result.traces import Channel
from discrepancy.team.causes import CAUSES
from discrepancy.team.closed_loop import Gain, Response
from discrepancy.team.diagnose import TeamOutcome
from discrepancy.team.response import write_model
from discrepancy.team.rig import TeamRig
from discrepancy.team.verdict import TeamVerdict
from estimator.arrays import Array


def signature(rig: TeamRig, z: Sequence[Array]) -> dict[str, Any]:
    """Describe the whitened residual beyond noise, shape (n, C) a trial, as plain numbers.

    Returns:
        ``chi2_per_n`` overall and by ``kind`` of channel, ``channel`` and ``trial``; ``moving_share``: share of the
        excess during motion; ``correlation`` of its size with the rig's explanatory quantities; ``worst_channel``;
        ``frequency_hz``: median frequency of that channel; ``along``: shares of the residual along the directions of
        its likeliest sources; ``sentence``.
    """
    squares = np.concatenate([(x**2) for x in z])
    out: dict[str, Any] = {"chi2_per_n": float(squares.mean())}
    kinds = sorted({channel.kind for channel in rig.channels})
    out["kind"] = {
        kind: float(squares[:, [k for k, c in enumerate(rig.channels) if c.kind == kind]].mean())
        for kind in kinds
    }
    out["channel"] = {c.name: float(squares[:, k].mean()) for k, c in enumerate(rig.channels)}
    out["trial"] = {name: float((x**2).mean()) for name, x in zip(rig.trials, z, strict=True)}
    size = np.concatenate([(x**2).mean(axis=1) for x in z])
    quantities = [rig.quantities(t) for t in range(len(rig.trials))]
    out["correlation"] = {}
    for name in quantities[0]:
        values = np.concatenate([q[name] for q in quantities])
        constant = np.std(values) < 1e-12 or np.std(size) < 1e-12
        out["correlation"][name] = 0.0 if constant else float(np.corrcoef(values, np.log(size + 1e-12))[0, 1])
    speed = np.concatenate([q["speed"] for q in quantities])
    moving = speed > 0.2 * np.sqrt(np.mean(speed**2))
    excess = np.maximum(size - 1.0, 0.0)
    out["moving_share"] = float(excess[moving].sum() / max(excess.sum(), 1e-12))
    worst = int(np.argmax(squares.mean(axis=0)))
    out["worst_channel"] = rig.channels[worst].name
    out["frequency_hz"] = _median_frequency(rig, z, worst)
    out["along"] = _along(rig, z)
    out["sentence"] = _sentence(out)
    return out


def _median_frequency(rig: TeamRig, z: Sequence[Array], channel: int) -> float:
    power, at = 0.0, None
    for t, x in enumerate(z):
        rate = rig.row_rate_hz(t)
        series = x[: len(x) // 2 * 2, channel]
        spectrum = np.abs(np.fft.rfft(series, 512)) ** 2
        power, at = power + spectrum, np.fft.rfftfreq(512, 1.0 / rate)
    total = np.cumsum(power)
    return float(at[np.searchsorted(total, 0.5 * total[-1])]) if at is not None else 0.0


def _along(rig: TeamRig, z: Sequence[Array]) -> dict[str, float]:
    """Share of the squared residual along the direction of each possible source, for the five largest."""
    shares: dict[str, list[float]] = {}
    total = sum(float(np.sum(x**2)) for x in z)
    for t, x in enumerate(z):
        for name, directions in rig.directions(t).items():
            inside = np.einsum("nc,nck->nk", x, directions)
            shares.setdefault(name, []).append(float(np.sum(inside**2)))
    ranked = sorted(((sum(v) / max(total, 1e-12), k) for k, v in shares.items()), reverse=True)
    return {name: share for share, name in ranked[:5]}


def _sentence(out: dict[str, Any]) -> str:
    kind = max(out["kind"], key=lambda k: out["kind"][k])
    source, share = next(iter(out["along"].items()), ("no single source", 0.0))
    motion = "while it moves" if out["moving_share"] > 0.6 else "at rest and in motion alike"
    return (
        f"chi2/n is {three_digits(out['kind'][kind])} in the {kind} channels (worst: {out['worst_channel']}, around "
        f"{out['frequency_hz']:.1f} Hz); {100 * share:.0f} % of the misfit lies along {source}, {motion}."
    )


UNDECIDABLE = (
    (
        "zero of the last gimbal axis",
        "it turns the grasp frame by a constant, and the grasp frame is itself unknown",
        "a grasp whose orientation is known",
    ),
    (
        "mass of the gimbal and the platform",
        "a point mass at the wrist is a part of the payload",
        "a run of the arm alone",
    ),
    (
        "a scale common to all torques",
        "it scales the payload's mass and inertia and nothing else",
        "a known weight on the payload",
    ),
    (
        "which robot's gimbal rubs",
        "a pure moment about parallel axes is the same wherever it acts; only the axis shows",
        "one robot released at a time",
    ),
)
"""Questions that a parked team with one rigid payload cannot answer: what, why, and what would answer them."""


UNITS = {"phi": "rad", "theta": "rad", "tau": "N m", "speed": "m/s", "position": "m", "load": "N m"}
"""Units of closed-loop channels, and of quantities that a misfit may depend on."""


def describe(candidate: Candidate, values: Mapping[str, float], se: Mapping[str, float]) -> str:
    """Describe the action of a cause at its place in a sentence with numbers; standard errors may be NaN."""
    cause = CAUSES[candidate.cause]
    return f"{cause.place(candidate)}: {cause.sentence(Numbers(values, se))}."


def statements(robots: int, *, aligned: bool) -> list[dict[str, Any]]:
    """Undecidable questions of a team of N robots: what, why, and what would decide them.

    Args:
        robots: N.
        aligned: whether the motion aligned the robots' clocks.
    """
    said = [{"what": what, "why": why, "remedy": remedy} for what, why, remedy in UNDECIDABLE]
    if aligned:
        why = "the conversion has taken out what the motion tells of the clocks"
        said.append(
            {"what": "the robots' clocks", "why": why, "remedy": "one clock for all, and no --clock correct"}
        )
    if robots == 1:
        what = "every error of angles, lengths, bases and grasps of a single robot"
        said.append(
            {"what": what, "why": "no other robot tells where the payload is", "remedy": "a second robot"}
        )
    return said


NOT_SIMULATED: Values = {
    "held_out": {"before": None, "after": None, "as_found": None}, "units": {}, "noise": {}, "removed": None,
    "validated": False, "trials": [],
}  # fmt: skip
"""Values of ``gain`` in the JSON without a simulation."""


class TeamValues(Told):
    """A verdict on a team as values with sentences."""

    machine = "team"
    verdict: TeamVerdict

    def at(self, cause: str, place: str, joint: int | None, partner: int | None = None) -> Values:
        candidate = self.verdict.candidates.get((cause, place))
        if candidate is not None:
            return place_of(candidate)
        kind = next((c.kind for (name, _), c in self.verdict.candidates.items() if name == cause), "")
        kind = kind or ("something unlisted" if cause in ("", "unlisted") else cause.replace("_", " "))
        return {"cause": cause, "kind": kind, "name": f"{kind} at {place}", "family": cause, "robot": None,
                "joint": joint, "place": place}  # fmt: skip

    def finding(self, f: Finding) -> Values:
        words, robot = words_of(f, f.place), re.search(r"of robot (\d+)$", f.place)
        return super().finding(f) | words | ({"robot": int(robot[1])} if words and robot else {})

    def sentence(self, f: Finding, place: str, parameters: Mapping[str, Mapping[str, Any]]) -> str:
        candidate = self.verdict.candidates.get((f.cause, f.place))
        if f.law is not None:
            return f"{f.law.sentence(place[:1].upper() + place[1:])}."
        if candidate is None or not parameters:
            return f"Something that no table lists acts at {place}."
        numbers = {name: entry["value"] for name, entry in parameters.items()}
        errors = {name: entry["se"] for name, entry in parameters.items() if entry["se"] is not None}
        return describe(candidate, numbers, errors)

    def separate(self, cause: str) -> str:
        return CAUSES[cause].separate if cause in CAUSES else ""

    def signature(self, which: str) -> Values:
        chi2 = self.verdict.chi2_per_n[0 if which == "before" else 2]
        return signature(self.verdict.rig, self.verdict.left[which]) | {"chi2_per_n": chi2}

    def undecidable(self) -> list[Values]:
        return statements(self.verdict.rig.robots, aligned=self.verdict.rig.aligned)


@dataclass(frozen=True, eq=False)
class TeamDiagnosed(Diagnosed[TeamVerdict]):
    """A verdict with the results of closed-loop simulations.

    Attributes:
        verdict: causes, sizes and their benefit.
        outcome: of the search.
        gain: responses in closed loop; None without a simulation.
        not_simulated: reason why there is no simulation.
        errors: of the payload's estimates ``before`` and ``after``, if the truth is known.
    """

    verdict: TeamVerdict
    outcome: TeamOutcome
    gain: Gain | None = None
    not_simulated: str | None = None
    errors: Mapping[str, Any] | None = None

    @cached_property
    def values(self) -> Values:
        gain = gain_to_dict(self.gain, self.verdict.rig) if self.gain else NOT_SIMULATED
        gain = gain | {"estimates": dict(self.verdict.estimates)}
        if self.errors is not None:
            gain["errors"] = dict(self.errors)
        values = TeamValues(self.verdict).values(gain, not_simulated=self.not_simulated)
        return values | {"remains": [*values["remains"], *of_response(values)]}

    def models(self) -> Iterator[tuple[str, str, Callable[[Path], None]]]:
        found = {(f.cause, f.place) for f in self.verdict.findings}
        chosen = [c for c in self.outcome.state.chosen if c.group.key in found]
        if chosen:
            yield EXTENDED, "extended model", partial(write_model, self.outcome, chosen, whole=False)
        if self.gain is not None and self.gain.is_better_as_found:
            yield AS_FOUND, "model as found", partial(write_model, self.outcome, chosen, whole=True)

    @property
    def channels(self) -> Sequence[Channel]:
        return self.verdict.rig.channels

    def unit(self, name: str) -> str:
        return UNITS[name]


def gain_to_dict(gain: Gain, rig: TeamRig) -> Values:
    """Convert responses to ``gain`` of the JSON."""
    channels = list(next((a.rms for a, _ in gain.pairs), {}))
    removed = excess_removed((a.chi2_per_n, b.chi2_per_n) for a, b in gain.pairs)
    if removed is not None:
        removed["interval"] = [x if np.isfinite(x) else None for x in removed["interval"]]
    both = zip((rig.trials[t] for t in rig.resimulated), gain.before, gain.after, strict=True)
    told = {"before": gain.before, "after": gain.after, "as_found": gain.as_found}
    return {
        "held_out": {name: _mean(each) for name, each in told.items()},
        "units": {name: UNITS[name] for name in channels},
        "noise": {f"{name}_rms": _noise(rig, name) for name in channels},
        "removed": removed,
        "validated": gain.held_out,
        "trials": [{"name": name, "before": _response(a), "after": _response(b)} for name, a, b in both],
    }


def _noise(rig: TeamRig, channel: str) -> float:
    squares = [np.mean(rig.response_scale(t)[channel][0] ** 2) for t in range(len(rig.trials))]
    return float(np.sqrt(np.mean(squares)))


def _response(response: Response | None) -> dict[str, float] | None:
    if response is None:
        return None
    sizes = {f"{name}_nrmse": float(v) for name, v in response.nrmse.items()}
    sizes |= {f"{name}_rms": float(v) for name, v in response.rms.items()}
    return sizes | {"chi2_per_n": float(response.chi2_per_n)}


def _mean(responses: Sequence[Response | None]) -> dict[str, float] | None:
    """Mean over all trials; None if a trial failed, because a mean over fewer trials is not comparable."""
    each = [values for values in map(_response, responses) if values is not None]
    whole = each and len(each) == len(responses)
    return {key: float(np.mean([values[key] for values in each])) for key in each[0]} if whole else None


def place_of(candidate: Candidate) -> dict[str, Any]:
    """Cause, family and place of a candidate, in names and words, with the keys used throughout the JSON."""
    return {
        "cause": candidate.cause,
        "kind": candidate.kind,
        "name": candidate.label,
        "family": candidate.family,
        "robot": candidate.robot,
        "joint": candidate.joint,
        "place": candidate.place,
    }
