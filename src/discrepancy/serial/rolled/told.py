"""Rollouts and the closed loop of serial robots as plain JSON values.

The key ``rollouts`` of a diagnosis, null of other machines and where it was left out on request:

joints, units       names in the model's order, and ``rad`` or ``m``
validated           false for a single block, to which everything was fitted
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
refused             what MuJoCo said of extended models that it does not compile, by block
commanded           the closed loop:
    why_not                        why there is none, or null
    joints                         whose loops are closed, from 1; the others get their logged torques
    blocks                         list of {name, seconds, motion, before, after}: rms position error over the block and
                                   standard deviation of the measured motion, lists over the joints; null where a joint
                                   diverged, ``after`` null where nothing is named
    before, after, removed         the same over all blocks in which a joint diverged in neither
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from discrepancy.engine.explanation import Explanation
from discrepancy.serial.rig import SerialRig
from discrepancy.serial.rolled.closed import ClosedLoop, closed_loop
from discrepancy.serial.rolled.free import FreeRollouts, Horizon, diverged, free_rollouts, rms
from estimator.arrays import Array


def rolled_out(rig: SerialRig, explanation: Explanation) -> dict[str, Any] | None:
    """Free rollouts and the closed loop, as documented above; None with a reference.

    With a reference what is wrong on both days has no values of its own, so no model has it, and it would hide what has
    changed.
    """
    if rig.common:
        return None
    joints = rig.model.joints
    missing = [name for j, name in enumerate(joints) if j not in rig.joints]
    why_not, free = None, FreeRollouts((), (), ())
    if missing:
        why_not = f"no torque of joint {missing[0]} is known"
    else:
        free = free_rollouts(rig, explanation)
        if not free.horizons:
            why_not = "nowhere in a block are torques and motion known for long enough"
    loop = closed_loop(rig, explanation)
    return {
        "joints": list(joints),
        "units": ["m" if slide else "rad" for slide in rig.model.slides],
        "validated": len(rig.trials) > 1,
        "why_not": why_not,
        "horizons": [_horizon(horizon) for horizon in free.horizons],
        "not_simulated": list(free.left_out),
        "refused": list(free.refused),
        "commanded": _commanded(loop, named=bool(explanation.found)),
    }


def _horizon(horizon: Horizon) -> dict[str, Any]:
    after = horizon.after
    return {
        "seconds": horizon.seconds,
        "starts": len(horizon.before),
        "before": _side(horizon.before),
        "after": None if after is None else _side(after),
        "removed": None if after is None else _plain(horizon.removed()),
    }


def _side(errors: Array) -> dict[str, Any]:
    return {"rms": _plain(rms(errors)), "diverged": [int(n) for n in diverged(errors)]}


def _commanded(loop: ClosedLoop | str, *, named: bool) -> dict[str, Any]:
    if isinstance(loop, str):
        return {"why_not": loop, "joints": [], "blocks": [], "before": None, "after": None, "removed": None}
    before = np.array([run.before for run in loop.runs])
    after = np.array([before[k] if run.after is None else run.after for k, run in enumerate(loop.runs)])
    both = np.isfinite(before) & np.isfinite(after)
    sides = [rms(np.where(both, errors, np.nan)) for errors in (before, after)]
    return {
        "why_not": None,
        "joints": [j + 1 for j in loop.joints],
        "blocks": [
            {
                "name": run.name,
                "seconds": run.seconds,
                "motion": _plain(run.motion),
                "before": _plain(run.before),
                "after": None if run.after is None else _plain(run.after),
            }
            for run in loop.runs
        ],
        "before": _plain(sides[0]),
        "after": _plain(sides[1]) if named else None,
        "removed": _plain(1.0 - sides[1] / np.where(sides[0] > 0, sides[0], np.nan)) if named else None,
    }


def _plain(values: Array | Sequence[float]) -> list[float | None]:
    return [float(x) if np.isfinite(x) else None for x in values]
