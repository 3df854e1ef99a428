"""A calibration's trial as plain JSON values; the keys are documented in ``estimator.calibrate.json``."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.unit import GROUPS
from estimator.calibrate.calibration import CalibratedTrial
from estimator.calibrate.outcome.robot_list import by_robot
from estimator.rigid_team.residual import Bases
from estimator.strict import Fields

KEYS = ("name", "kind", "payload", "duration_s", "count", "chi2_per_n", "bases")
BASE, FITS, PAIR = ("i", "yaw_deg", "p_m"), ("before", "after", "held_out"), ("loops", "balance")
SHARED = (*(group.name for group in GROUPS), "grasps", "inertial_parameters")
KINDS = ("random", "periodic", "static", "free")


def trial_to_dict(trial: CalibratedTrial) -> dict[str, Any]:
    """Plain values of a trial."""
    bases = trial.bases
    return {
        "name": trial.name,
        "kind": trial.kind,
        "payload": trial.payload,
        "duration_s": float(trial.duration_s),
        "count": dict(zip(PAIR, trial.count, strict=True)),
        "chi2_per_n": {
            "before": _fit(trial.before, trial.count),
            "after": _fit(trial.after, trial.count),
            "held_out": _fit(trial.held_out, trial.count),
        },
        "bases": bases
        and [
            {"i": i + 1, "yaw_deg": float(np.rad2deg(np.arctan2(R[1, 0], R[0, 0]))), "p_m": p.tolist()}
            for i, (R, p) in enumerate(zip(bases.R, bases.p, strict=True))
            if i
        ],
        "shares": {name: float(share) for name, share in trial.shares.items()},
    }


def _fit(pair: tuple[float, float] | None, count: tuple[int, int]) -> dict[str, float | None] | None:
    if pair is None:
        return None
    return {name: float(v) if n else None for name, v, n in zip(PAIR, pair, count, strict=True)}


def trial_from_dict(entry: Any, N: int, payloads: int, where: str) -> CalibratedTrial:
    """Inverse of ``trial_to_dict``, for N robots and so many payloads; ``where`` is how messages call it.

    Raises:
        InputError: something is missing or not allowed.
    """
    read = Fields(entry, KEYS, where, ("shares",))
    payload = None if read.values["payload"] is None else read.whole("payload", 0)
    if payload is not None and payload >= payloads:
        read.refuse("payload", f"the index, from 0, of one of {payloads} payloads")
    count = read.within("count", PAIR)
    fits = read.within("chi2_per_n", FITS)
    after = _read_fit(fits, "after")
    if after is None:
        fits.refuse("after", "an object")
    return CalibratedTrial(
        name=read.words("name"),
        kind=read.one_of("kind", KINDS),
        payload=payload,
        duration_s=read.number("duration_s", 0.0),
        count=(count.whole("loops", 0), count.whole("balance", 0)),
        before=_read_fit(fits, "before"),
        after=after,
        held_out=_read_fit(fits, "held_out"),
        bases=None if read.values["bases"] is None else _read_bases(read, N),
        shares=_read_shares(read),
    )


def _read_fit(fits: Fields, key: str) -> tuple[float, float] | None:
    if fits.values[key] is None:
        return None
    inner = fits.within(key, PAIR)
    loops, balance = (None if inner.values[name] is None else inner.number(name, 0.0) for name in PAIR)
    return loops or 0.0, balance or 0.0


def _read_shares(read: Fields) -> dict[str, float]:
    if "shares" not in read:
        return {}
    inner = Fields(read.object("shares"), (), f"{read.where}: shares", SHARED)
    return {name: inner.number(name, 0.0) for name in inner.values}


def _read_bases(read: Fields, N: int) -> Bases:
    R, p = np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3))
    for i, one in enumerate(by_robot(read, "bases", N, BASE), 1):
        R[i] = Rotation.from_euler("z", one.number("yaw_deg"), degrees=True).as_matrix()
        p[i] = one.array("p_m", (3,))
    return Bases(R, p)
