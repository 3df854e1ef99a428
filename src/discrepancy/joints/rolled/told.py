"""Rollouts and the closed loop of robots of joints as plain JSON values.

The key ``rollouts`` of a diagnosis, null of other machines and where it was left out on request:

joints, units       names in the model's order, and ``rad`` or ``m``
validated           false for a single trial, to which everything was fitted
why_not             why there are no free rollouts, or null
horizons            list, empty where there are none, of
    seconds                        how far ahead
    starts                         how many rollouts there are
    before, after                  {rms, diverged} of the given and of the extended model, lists over the joints: rms
                                   position error over the starts at which the joint did not diverge (null: it did at
                                   more than half of them), and at how many it did; ``after`` is null where nothing is
                                   named
    removed                        share of the rms removed, over the starts at which the joint diverged in neither;
                                   null where these are less than half
not_simulated       named causes that the rollouts lack
refused             what MuJoCo said of extended models that it does not compile, by trial
commanded           the closed loop:
    why_not                        why there is none, or null
    joints                         whose loops are closed, from 1; the others get their logged torques
    blocks                         list of {name, seconds, motion, before, after}: rms position error over the trial and
                                   standard deviation of the measured motion, lists over the joints; null where a joint
                                   diverged, ``after`` null where nothing is named
    before, after, removed         the same over all trials in which a joint diverged in neither
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from discrepancy.joints.effects import label
from discrepancy.joints.findings import JointVerdict
from discrepancy.joints.rolled.closed import MOST_LOOP_S, LoopRun, laws_without, loop_run
from discrepancy.joints.rolled.free import HORIZONS_S, Horizon, Trial, diverged, in_neither, rms, roll_freely
from discrepancy.joints.rolled.robot import Robot
from estimator.arrays import Array
from estimator.errors import InputError

DIVERGED_RAD = math.pi
"""How far off a joint that turns may be. Derived: from half a turn on its angle says nothing of where the link is.
A joint that slides may be off by the extent of the model, or by its own travel in the log if that is more."""
TOLD_S = 2.0
"""Between lines of progress."""


def rolled_out(verdict: JointVerdict, say: Callable[[str], object] = lambda _: None) -> dict[str, Any] | None:
    """Free rollouts and the closed loop, as documented above; None with a reference.

    With a reference what is wrong on both days has no values of its own, so no model has it, and it would hide what has
    changed.

    Args:
        verdict: each trial is rolled out with findings that are fitted to the others.
        say: takes a line of progress.
    """
    if verdict.reference:
        return None
    model, parts, named = verdict.model, verdict.parts, bool(verdict.findings)
    travel = np.max([np.ptp(s.q, axis=0) for s in parts], axis=0)
    extent = np.maximum(float(model.model.stat.extent), travel)
    limit = np.where(model.slides, extent, DIVERGED_RAD)
    known = np.all([s.usable.any(axis=0) for s in parts], axis=0)
    why_not = None if known.all() else f"no torque of joint {model.joints[int(np.argmin(known))]} is known"
    horizons, runs, refused = [Horizon(h) for h in HORIZONS_S], [], []
    left = {label(f): None for f in verdict.findings if f.event is not None or f.cause == "unlisted"}
    lengths, loop_why = [len(s.time) / s.rate_hz for s in parts], ""
    for k, (s, name) in enumerate(zip(parts, verdict.trials, strict=True)):
        given, found = Robot.of(model, (), s.rate_hz), None
        try:
            found = Robot.of(model, verdict.by_the_others(k), s.rate_hz) if named else given
            left = dict.fromkeys(found.left_out) | left
        except InputError as error:
            refused.append(f"{name}: {error}")
        events = [f.event for f in verdict.findings if f.event is not None and f.event.trial == k]
        tick = _Progress(say, f"rolling out {name} (trial {k + 1} of {len(parts)})")
        trial = Trial(s, given, found, limit, events, tick)
        if why_not is None:
            roll_freely(trial, horizons, sum(lengths[:k]), sum(lengths))
        laws = laws_without(parts, k)
        run = loop_run(trial, model.joints, verdict.motors, laws, MOST_LOOP_S / len(parts))
        if isinstance(run, LoopRun):
            runs.append((name, run))
        else:
            loop_why = run
    horizons = [h for h in horizons if h.before]
    if why_not is None and not horizons:
        why_not = "nowhere in a trial are torques and motion known for long enough"
    return {
        "joints": list(model.joints),
        "units": ["m" if slide else "rad" for slide in model.slides],
        "validated": len(parts) > 1,
        "why_not": why_not,
        "horizons": [_horizon(horizon, named=named) for horizon in horizons],
        "not_simulated": list(left),
        "refused": refused,
        "commanded": _commanded(runs, loop_why, named=named),
    }


class _Progress:
    """Says now and then how far a trial is."""

    def __init__(self, say: Callable[[str], object], what: str) -> None:
        self._say, self._what = say, what
        self._last = time.monotonic()
        say(what)

    def __call__(self, at: float) -> None:
        now = time.monotonic()
        if now - self._last > TOLD_S:
            self._last = now
            self._say(f"{self._what}: at {at:.1f} s")


def _horizon(horizon: Horizon, *, named: bool) -> dict[str, Any]:
    before, after = np.array(horizon.before), np.array(horizon.after)
    return {
        "seconds": horizon.seconds,
        "starts": len(before),
        "before": _side(before),
        "after": _side(after) if named else None,
        "removed": _plain(in_neither(before, after)[2]) if named else None,
    }


def _side(errors: Array) -> dict[str, Any]:
    return {"rms": _plain(rms(errors)), "diverged": [int(n) for n in diverged(errors)]}


def _commanded(runs: Sequence[tuple[str, LoopRun]], why_not: str, *, named: bool) -> Mapping[str, Any]:
    if not runs:
        return {
            "why_not": why_not, "joints": [], "blocks": [], "before": None, "after": None, "removed": None
        }  # fmt: skip
    each = (np.array([getattr(run, side) for _, run in runs]) for side in ("before", "after"))
    before, after, removed = in_neither(*each)
    return {
        "why_not": None,
        "joints": [j + 1 for j in runs[-1][1].joints],
        "blocks": [
            {
                "name": name,
                "seconds": run.seconds,
                "motion": _plain(run.motion),
                "before": _plain(run.before),
                "after": _plain(run.after) if named else None,
            }
            for name, run in runs
        ],
        "before": _plain(before),
        "after": _plain(after) if named else None,
        "removed": _plain(removed) if named else None,
    }


def _plain(values: Array | Sequence[float]) -> list[float | None]:
    return [float(x) if np.isfinite(x) else None for x in values]
