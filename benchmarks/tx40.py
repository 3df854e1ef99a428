"""A real six-axis arm, from its maker's model alone: what is named, how stable it is, what it is worth.

    python benchmarks/tx40.py

Needs the published excitation run (``models/tx40/README.md`` says where it is from): put it into
``data/tx40`` or set MOCOBOT_TX40_DATA to its file.
Torques are low-passed as the rows of the diagnosis are, and compared while a joint moves: at rest friction is anything.
Everything is fitted to the first two thirds of the log, causes and their shapes included, and tried on the last third.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from discrepancy.serial.diagnosis import diagnose_rig
from discrepancy.serial.errors import with_errors
from discrepancy.serial.laws.rig import LawfulSerialRig
from discrepancy.serial.rig import SerialRig

from discrepancy.candidate import Candidate
from discrepancy.joints.model import SerialModel, load_model
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rules import serial as rules
from mocobot_logs.joints.joint_log import JointLog
from mocobot_logs.joints.parse import read_joint_map
from mocobot_logs.joints.read import open_joint_log, read_joint_log

VARIABLE = "MOCOBOT_TX40_DATA"
TOP = Path(__file__).resolve().parents[1]
FILE = TOP / "data" / "tx40" / "excitation.parquet"
Active = Sequence[tuple[Candidate, np.ndarray]]
FADES = "warming"
STANDARD = ("link_mass", "link_com", "link_inertia", "armature", "friction", "torque_offset")
"""Ten inertial numbers, rotor, Coulomb, viscous friction and offset: 14 a joint."""


def data() -> Path:
    """The file, or a message and the end of the program."""
    path = Path(os.environ.get(VARIABLE) or FILE)
    if not path.is_file():
        raise SystemExit(f"the TX40's excitation run is needed: set {VARIABLE} to its file ({path} is none)")
    return path


def read() -> tuple[SerialModel, JointLog]:
    """Model and log."""
    model = load_model(TOP / "models" / "tx40" / "tx40.xml")
    log_map = read_joint_map(TOP / "models" / "tx40" / "log.toml", model.joints, list(model.slides))
    (log,) = read_joint_log(open_joint_log(data(), log_map), log_map)
    return model, log


def crop(log: JointLog, start: float, stop: float) -> JointLog:
    """A part of a log, by shares of it."""
    here = slice(round(start * len(log.time)), round(stop * len(log.time)))
    assert log.torque is not None
    return replace(log, time=log.time[here], q=log.q[here], torque=log.torque[here], usable=log.usable[here])


def plain(rig: SerialRig, kinds: tuple[str, ...], trials: list[int]) -> np.ndarray:
    """What plain least squares leaves of the last block: numbers of all kinds, fitted to some blocks by least norm."""
    chosen = [c for c in rig.candidates() if c.cause in kinds]
    # Joints count by the size of their torques, as is usual.
    torques = [part.reduction(part.signals.torque)[k] for part in rig.parts for k in range(len(part.blocks))]
    scale = np.sqrt(np.mean(np.concatenate([torques[t] for t in trials]) ** 2, axis=0))
    columns = [np.concatenate(own, axis=2) for own in zip(*(rig.physical(c) for c in chosen), strict=True)]
    left = rig.physical_residual([])
    A = np.concatenate([(columns[t] / scale[:, None]).reshape(-1, columns[t].shape[2]) for t in trials])
    b = np.concatenate([(left[t] / scale).ravel() for t in trials])
    size = np.linalg.norm(A, axis=0)
    size = np.where(size > 0, size, 1.0)
    values = np.linalg.lstsq(A / size, b, rcond=1e-4)[0] / size  # base parameters: what is not seen stays
    return left[-1] - columns[-1] @ values


def shown(error: np.ndarray, torque: np.ndarray) -> str:
    """Relative errors per joint in percent, both of joints in motion."""
    share = np.sqrt(np.mean(error**2, axis=0) / np.mean(torque**2, axis=0))
    return "".join(f"{100 * x:8.1f}" for x in share)


def frictions(
    model: SerialModel, log: JointLog, causes: list[Candidate], told: Active = ()
) -> dict[int, np.ndarray]:
    """Coulomb and viscous friction by joint, all given causes fitted together beside those with known values."""
    rig = LawfulSerialRig.of(model, [log])
    kept = {c.key: c for c in causes}
    every = [kept.get(c.key, c) for c in rig.candidates()]
    every += [c for c in causes if c.key not in {k.key for k in every}]
    problem = Problem.of(rig.rows(every), every).with_residual(rig.residual(np.zeros(0), [], told))
    fit = Fit.of(problem, [k for k, c in enumerate(every) if c.key in kept])
    return {c.joint: v for c, v in fit.active if c.cause == "friction" and c.joint is not None}


def show_halves(model: SerialModel, log: JointLog, active: Active, *, of_one_moment: bool) -> None:
    """Print every joint's friction from both halves of the log.

    Friction that fades is another in the second half than in the first. How it fades is known from the whole log
    alone: with that, both halves tell the friction of one moment; without, each its own mean.
    """
    lasting = [c for c, _ in active if c.cause != FADES]
    told = [(c, v) for c, v in active if c.cause == FADES] if of_one_moment else []
    shares = ((0.0, 0.5), (0.5, 1.0))
    halves = [frictions(model, crop(log, *share), lasting, told) for share in shares]
    for joint in sorted(halves[0]):
        (c1, v1), (c2, v2) = halves[0][joint], halves[1][joint]
        apart = [200 * abs(a - b) / abs(a + b) for a, b in ((c1, c2), (v1, v2))]
        print(
            f"  joint {joint}: {c1:7.3f} {c2:7.3f} ({apart[0]:4.1f} %) {v1:8.3f} {v2:8.3f} ({apart[1]:4.1f} %)"
        )


def drift(rig: SerialRig, active: Active) -> dict[int, np.ndarray]:
    """Share by which a joint's friction grows over the log, with its standard error, shape (2,), by joint.

    What all causes leave of its torque in motion is fitted by more Coulomb and viscous friction and by a share of both
    together that grows evenly with time. Errors are those of half seconds.
    """
    left = np.concatenate(rig.physical_residual(active))
    time = np.concatenate([rig.row_times(t) for t in range(len(rig.trials))])
    moves = np.concatenate([_moves(rig, t) for t in range(len(rig.trials))])
    out = {}
    for cause, values in active:
        if cause.cause == "friction" and cause.joint is not None:
            j = cause.joint - 1
            here = moves[:, j] > 0.98
            columns = np.concatenate(rig.physical(cause))[here, j, :]
            when = (time[here] - time.mean()) / np.ptp(time)
            A = np.column_stack([columns, columns @ values * when])
            normal = np.linalg.inv(A.T @ A)
            found = normal @ (A.T @ left[here, j])
            rest, half = left[here, j] - A @ found, (time[here] / rules.ERROR_BLOCK_S).astype(int)
            scores = np.array([A[half == k].T @ rest[half == k] for k in np.unique(half)])
            out[cause.joint] = np.array([found[2], np.sqrt((normal @ scores.T @ scores @ normal)[2, 2])])
    return out


def _moves(rig: SerialRig, trial: int) -> np.ndarray:
    """How much of every row of a block joints are in motion, shape (n, J); 1 is all of it."""
    share = rig.in_motion(np.ones((len(rig.row_times(trial)), len(rig.joints))), trial)
    return share / share.max(axis=0)


def main() -> None:
    """Print the tables."""
    model, log = read()
    start = time.process_time()
    whole = LawfulSerialRig.of(model, [log])
    found = diagnose_rig(whole)
    spent = time.process_time() - start
    explanation = with_errors(found.explanation, max(2, round(rules.ERROR_BLOCK_S * whole.row_rate_hz(0))))
    print(f"{len(log.time)} samples at {log.rate_hz:g} Hz; {found.verdict}; {spent:.1f} s of CPU")
    for item in explanation.found:
        values, se = whole.effect_parameters(item.candidate, item.values, item.covariance)
        numbers = ", ".join(f"{n} {v:.4g} +- {se[n]:.2g}" for n, v in values.items() if np.isfinite(se[n]))
        held = "" if item.held_out is None else f", {100 * item.held_out:.1f} % held out"
        print(f"  {item.candidate.label}: {numbers}{held}")
    print(
        "\nCoulomb [N m] and viscous [N m s/rad] friction from the first and the second half, of one moment"
    )
    active = [(item.candidate, item.values) for item in explanation.found]
    show_halves(model, log, active, of_one_moment=True)
    print("\nThe same, each half as it is")
    show_halves(model, log, active, of_one_moment=False)
    print("\nChange of friction over the log [%]")
    for joint, (share, se) in drift(whole, active).items():
        print(f"  joint {joint}: {100 * share:+.1f} +- {100 * se:.1f}")
    print("\nTorque left unforetold in the last third, rms over that of the torque [%]")
    last = len(whole.trials) - 1
    part = whole.parts[0]
    torque = whole.in_motion(part.reduction(part.signals.torque)[last], last)
    print(f"  {'':<44}" + "".join(f"{name:>8}" for name in model.joints))
    bare = whole.in_motion(whole.physical_residual([])[last], last)
    print(f"  {'the bare model':<44}" + shown(bare, torque))
    for title, kinds in (
        ("plain least squares, 14 numbers a joint", STANDARD),
        ("the same, and the coupled drives", (*STANDARD, "coupled_drive")),
    ):
        began = time.process_time()
        left = whole.in_motion(plain(whole, kinds, list(range(last))), last)
        print(f"  {title:<44}{shown(left, torque)}  ({time.process_time() - began:.2f} s)")
    began = time.process_time()
    first = LawfulSerialRig.of(model, [crop(log, 0.0, 2.0 / 3.0)])
    named = diagnose_rig(first).explanation
    active = [(item.candidate, item.values) for item in named.found]
    left = whole.simulation(last, np.zeros(0), np.zeros(0), active)()
    spent = time.process_time() - began
    assert left is not None
    error = np.column_stack(list(left.values()))
    print(
        f"  {f'{len(active)} causes named from the first two thirds':<44}{shown(error, torque)}  ({spent:.1f} s)"
    )


if __name__ == "__main__":
    main()
