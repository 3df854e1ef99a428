"""Detection limits of forms, from their traces as simulated, not as any law says.

A trial is simulated with and without the form, and read by ideal sensors. The difference of the whitened rows is held
against grasps, payload, bases and every cause of the catalogue within its tolerance. At the limit of a listed cause
chi-square falls by 38 (``mocobot.campaign.limits``) when its answer is freed from its tolerance; at that of an unlisted
one, 38 are left that no healthy team explains. Both grow with the square of the size.

``python benchmarks/sealed/measure.py tether payload_cable`` prints them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from discrepancy.candidate import Candidate, Transient
from discrepancy.team.causes import CAUSES
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.start import exact_residual
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import default_tolerances, read_tolerances
from estimator.estimate.payload import estimate_payload
from hidden.schedule import Schedule
from mocobot.campaign.limits import GAIN
from mocobot_sim.effects import Effect, apply_effects
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.trial_log import TrialLog
from sealed.backgrounds import BACKGROUNDS, TIMES, Background
from sealed.draw import CATALOGUE, MOST, draw
from sealed.forms.base import Form
from sealed.ground import Ground
from sealed.registry import FORMS
from sealed.sets import SCHEDULE, TIMESTEP_S

SHORT = Schedule(randoms=1, vias=16, periodic_s=20.0, hold_s=None)
SEED = 0
UNCALIBRATED = {
    "phi_zero": {"zero_rad": np.deg2rad(1.0)},
    "theta_zero": {"zero_rad": np.deg2rad(1.0)},
    "link_length": {"proximal_m": 1e-3, "rod_m": 1e-3, "base_radius_m": np.sqrt(2.0) * 1e-3},
    "sea_scale": {"scale": 0.02},
    "sea_bias": {"bias_Nm": 0.02},
}
"""Spread of an uncalibrated team (``mocobot_sim.trial.sensors``) in terms of the catalogue."""


@dataclass(frozen=True)
class Bench:
    """A team without effects, and what its rows make of a change.

    Attributes:
        payload: its name.
        ground: for draws.
        rig: of its recordings, read by nominal sensors.
        clean: whitened rows of ideal sensors, one array per trial, shape (n, C).
        columns: derivatives by everything that is held or unknown, shape (rows, k), causes first.
        spans: where the columns of each cause are, by cause and place.
        priors: standard deviations of the causes' parameters, by background.
        weight: time of the campaign's trials over that of these.
        schedule: what is simulated.
    """

    payload: str
    ground: Ground
    rig: TeamRig
    clean: list[np.ndarray]
    columns: np.ndarray
    spans: dict[tuple, slice]
    priors: dict[Background, np.ndarray]
    weight: float
    schedule: Schedule

    @classmethod
    def of(cls, payload: str, schedule: Schedule = SHORT) -> Bench:
        """Simulate and linearise."""
        seed = SEED
        team = build_team(payload)
        trajectories = schedule.trajectories(team, np.random.default_rng(seed))
        logs = _logs(payload, schedule, seed, [])
        preset = sensor_preset("nominal")
        read = [measure(log, preset, np.random.default_rng([seed, k])) for k, log in enumerate(logs)]
        rig = TeamRig.of(read, estimate_payload(read), read_tolerances(None))
        whole = sum(t.duration_s for t in SCHEDULE.trajectories(team, np.random.default_rng(seed)))
        weight = whole / sum(t.duration_s for t in trajectories)
        candidates = [c for c in rig.candidates() if all(p.tolerance > 0 for p in c.parameters)]
        ends = np.cumsum([0, *(len(c.parameters) for c in candidates)])
        spans = {c.key: slice(a, b) for c, a, b in zip(candidates, ends[:-1], ends[1:], strict=True)}
        priors = {k: np.concatenate([_priors(c, k) for c in candidates]) for k in BACKGROUNDS}
        columns = np.sqrt(weight) * _columns(rig, candidates)
        bench = cls(payload, Ground.of(team, trajectories), rig, [], columns, spans, priors, weight, schedule)
        return replace(bench, clean=bench.rows(logs))

    def rows(self, logs: Sequence[TrialLog]) -> list[np.ndarray]:
        """Whitened rows of ideal sensors."""
        out = []
        for log, linear, white in zip(logs, self.rig.linear, self.rig.whitening, strict=True):
            signals = Signals.of(measure(log, sensor_preset("ideal"), np.random.default_rng(0)))
            rows = exact_residual(signals, linear.shared, linear.bases, linear.arms, linear.reduction)
            out.append(white(rows))
        return out

    def trace(self, effects: Sequence[Effect]) -> np.ndarray:
        """What effects change in the whitened rows of all trials, as many as the campaign has, in one vector."""
        rows = self.rows(_logs(self.payload, self.schedule, SEED, effects))
        change = np.concatenate([(a - b).ravel() for a, b in zip(rows, self.clean, strict=True)])
        return np.sqrt(self.weight) * change

    def fitted(self, effect: Effect) -> tuple[np.ndarray, float]:
        """Values of an effect's own cause, those that show, that fit its trace best, and the share that they leave.

        Only unknowns that any recording has are fitted beside it.
        """
        trace, (span, event) = self.trace([effect]), self._answer(effect)
        unknowns = self.columns[:, len(self.priors["x1"]) :]
        if event is not None:
            own, units = event[0], event[2]
        else:
            own = self.columns[:, span]
            units = np.ones(own.shape[1])
        shown = own.any(axis=0)  # some parameters have columns in other shapes only
        own, units = own[:, shown], units[shown]
        both = np.hstack([own, unknowns])
        scale = 1.0 / np.linalg.norm(both, axis=0)
        values = np.linalg.lstsq(both * scale, trace, rcond=1e-9)[0] * scale
        free = np.linalg.lstsq(unknowns * scale[own.shape[1] :], trace, rcond=1e-9)[0]
        before = trace - unknowns @ (free * scale[own.shape[1] :])
        left = trace - both @ values
        return values[: own.shape[1]] * units, float(left @ left / (before @ before))

    def over_limit(self, effects: Sequence[Effect]) -> dict[Background, float]:
        """Size of effects over their detection limit, in every background; all have the answer of the first."""
        trace = self.trace(effects)
        span, event = self._answer(effects[0])
        out: dict[Background, float] = {}
        for background, priors in self.priors.items():
            ridge = np.concatenate([priors**-2.0, np.zeros(self.columns.shape[1] - len(priors))])
            left = _left(self.columns, ridge, trace)
            if event is not None:
                columns, held, _ = event
                both, none = np.hstack([self.columns, columns]), np.zeros(columns.shape[1])
                if held:
                    left = _left(both, np.concatenate([ridge, none + 1.0]), trace)
                left -= _left(both, np.concatenate([ridge, none]), trace)
            elif span is not None:
                ridge[span] = 0.0
                left -= _left(self.columns, ridge, trace)
            out[background] = float(np.sqrt(max(left, 0.0) / GAIN))
        return out

    def _answer(self, effect: Effect) -> tuple[slice | None, tuple[np.ndarray, bool, np.ndarray] | None]:
        """Where the columns of the right answer are; or those of an event, whether it is tolerated, their units."""
        cause = effect.answer if isinstance(effect, Form) else effect.cause
        robot, joint = getattr(effect, "robot", None), getattr(effect, "joint", None)
        if cause not in CAUSES:
            return None, None
        for key in (
            (cause, robot, joint),
            (cause, robot, None),
        ):  # one sensor's lag is its robot's, if need be
            if key in self.spans:
                return self.spans[key], None
        if CAUSES[cause].transient:
            when = Transient(effect.trial - 1, effect.start_s, effect.duration_s)
            event = CAUSES[cause].event(default_tolerances().get(cause, {}), when)
        else:
            event = next((c for c in self.rig.candidates() if c.key == (cause, robot, joint)), None)
            if event is None:
                return None, None
            shape = {name: getattr(effect, name) for name in event.shape if hasattr(effect, name)}
            if cause == "payload_tether" and hasattr(effect, "point_x_m"):
                pi = self.rig.linear[0].shared.pi
                point = [getattr(effect, f"point_{axis}_m") for axis in "xyz"]
                shape = dict(zip(event.shape, point - pi[1:4] / pi[0], strict=True))
            event = replace(event, shape={**event.shape, **shape})
        columns = np.concatenate([c.reshape(-1, c.shape[2]) * event.units for c in self.rig.columns(event)])
        return None, (
            np.sqrt(self.weight) * columns,
            all(p.tolerance > 0 for p in event.parameters),
            event.units,
        )


def _left(columns: np.ndarray, ridge: np.ndarray, trace: np.ndarray) -> float:
    """Chi-square that a fit with priors leaves of a trace."""
    gram, right = columns.T @ columns, columns.T @ trace
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram) + ridge, 1e-300))
    system = (gram + np.diag(ridge)) * np.outer(scale, scale)
    return float(trace @ trace - (right * scale) @ np.linalg.lstsq(system, right * scale, rcond=1e-11)[0])


def _logs(payload: str, schedule: Schedule, seed: int, effects: Sequence[Effect]) -> list[TrialLog]:
    trajectories = schedule.trajectories(build_team(payload), np.random.default_rng(seed))
    out = []
    for number, trajectory in enumerate(trajectories, start=1):
        scene = apply_effects(build_team(payload, timestep_s=TIMESTEP_S), effects)
        out.append(run_trial(scene, trajectory, trial_number=number))
    return out


def _columns(rig: TeamRig, candidates: Sequence[Candidate]) -> np.ndarray:
    """Derivatives of all rows, shape (rows, k): of causes, of shared unknowns, of every trial's own."""
    rows, blocks = list(rig.rows(candidates)), []
    for t, trial in enumerate(rows):
        local = [
            other.local if s == t else np.zeros((*trial.residual.shape, other.local.shape[2]))
            for s, other in enumerate(rows)
        ]
        block = np.concatenate([*trial.causes, trial.shared, *local], axis=2)
        blocks.append(block.reshape(-1, block.shape[2]))
    return np.concatenate(blocks)


def _priors(candidate: Candidate, background: Background) -> np.ndarray:
    own, times = default_tolerances()[candidate.cause], TIMES.get(background, 1.0)
    wide = UNCALIBRATED.get(candidate.cause, {}) if background == "uncalibrated" else {}
    return np.array([wide.get(p.name, times * own[p.name]) for p in candidate.parameters])


def limits_of(
    names: Sequence[str], benches: Sequence[Bench], factor: float = 4.0, draws: int = 2
) -> dict[str, dict[Background, float]]:
    """Detection limits over those that ``sealed.limits`` has for robots within tolerances: medians over draws."""
    out = {}
    for name in names:
        found: dict[Background, list[float]] = {background: [] for background in BACKGROUNDS}
        for k in range(draws):
            bench = benches[k % len(benches)]
            rng = np.random.default_rng([k, *name.encode()])
            size = min(factor, 0.4 * MOST.get(name, np.inf))
            effects = draw(name, size, "x1", bench.ground, rng)
            for background, over in bench.over_limit(effects).items():
                found[background].append(size / over if over else np.inf)
        out[name] = {background: float(np.median(values)) for background, values in found.items()}
    return out


def main(names: tyro.conf.Positional[tuple[str, ...]], draws: int = 8) -> None:
    """Print detection limits over those of the tables for robots within tolerances.

    Args:
        names: causes and forms.
        draws: places of each.
    """
    known = {*CATALOGUE, *FORMS}
    if not names or not known.issuperset(names) or draws < 1:
        wrong = ", ".join(sorted({*names} - known)) or (f"--draws {draws}" if names else "no name")
        print(
            f"measure.py: {wrong}; names are of {', '.join(sorted(known))}, draws 1 or more", file=sys.stderr
        )
        sys.exit(2)
    benches = [Bench.of(payload) for payload in ("b", "c")]
    for name in names:
        (found,) = limits_of([name], benches, draws=draws).values()
        print(name, *(f"{background} {over:.3g}" for background, over in found.items()), sep="  ", flush=True)


if __name__ == "__main__":
    tyro.cli(main)
