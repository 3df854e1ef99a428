"""A real position servo: its motor, its friction and its loop from the logs, and one gain predicted from the others.

    python benchmarks/xl330.py

Needs the published runs (``models/xl330/README.md`` says where they are from): put them into
``data/xl330`` or set MOCOBOT_XL330_DATA to their folder.
For every gain the runs of the other two are diagnosed; what is named there, and the loop's law, predict the held-out
runs from their commands alone. Beside it a motor with the same torque constant and loop, whose Coulomb and viscous
friction are fitted to the same runs by least squares. Both are simulated by MuJoCo as the diagnosis does it.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import tyro

from discrepancy.evidence.findings import Finding, Member
from discrepancy.joints.model import load_model
from discrepancy.joints.rolled import LoopDrive, Robot
from discrepancy.joints.servo import LoopLaw, Servo, loop_laws, servo_of
from discrepancy.joints.verdict import JointVerdict, judged
from mocobot.serial import read_logs
from mocobot_logs.joints.joint_log import JointLog
from mocobot_sim.serial.extended import Start, rollout

VARIABLE = "MOCOBOT_XL330_DATA"
TOP = Path(__file__).resolve().parents[1]
FOLDER = TOP / "data" / "xl330"
GAINS = (100, 200, 400)


def plain(verdict: JointVerdict) -> Finding:
    """Coulomb and viscous friction by least squares over samples that move."""
    left, right = [], []
    for s in verdict.parts:
        at = s.usable[:, 0] & (np.abs(s.dq[:, 0]) > s.slow[0])
        left.append(np.column_stack([np.sign(s.dq[at, 0]), s.dq[at, 0]]))
        right.append((s.torque - s.inverse)[at, 0])
    coulomb, viscous = np.linalg.lstsq(np.concatenate(left), np.concatenate(right), rcond=None)[0]
    numbers = {"coulomb_Nm": max(float(coulomb), 0.0), "viscous_Nms_per_rad": max(float(viscous), 0.0)}
    name = verdict.model.joints[0]
    return Finding("friction", name, 1, (Member(name, 1, numbers, numbers),), 1.0, 0.0, 0.0, 0.0)


def share_left(
    found: Sequence[Finding], verdict: JointVerdict, laws: Sequence[LoopLaw], log: JointLog
) -> float:
    """Position error (rms) of the simulated loop under a log's commands, over the motion's standard deviation [%]."""
    robot = Robot.of(verdict.model, found, log.rate_hz)
    servo = servo_of(log, 0, verdict.motors, laws, verdict.model.joints[0])
    assert isinstance(servo, Servo), servo
    drive = LoopDrive.of(log, [servo], robot.readings)
    start = Start(0.0, log.q[0], np.zeros(1), np.zeros(1))
    error = rollout(robot.built, start, drive, len(log.q) - 1, robot.every) - log.q
    return 100.0 * float(np.sqrt(np.mean(error**2)) / np.std(log.q[:, 0]))


def told(verdict: JointVerdict, seconds: float) -> None:
    """Print what is named, with its numbers."""
    print(f"  {verdict.verdict}, {seconds:.1f} s of CPU; {verdict.motors[0].torque_per_unit:.4f} N m/V")
    for f in verdict.findings:
        numbers = [  # the numbers of a law's shape have no error
            f"{n} {m.values[n]:.4g} +- {m.errors.get(n, 0.0):.2g}" for m in f.members for n in m.values
        ]
        print(f"  {f.cause}: {', '.join(numbers) or f.of} ({100.0 * f.probability:.0f} %)")


def main() -> None:
    """Print the tables."""
    folder = Path(os.environ.get(VARIABLE) or FOLDER)
    files = sorted(folder.glob("kp*.csv"))
    if not files:
        raise SystemExit(f"the XL330's runs are needed: set {VARIABLE} to their folder ({folder} has none)")
    model = load_model(TOP / "models" / "xl330" / "xl330.xml")
    logs = read_logs(files, model)
    for law in loop_laws(logs):
        print(f"gain {law.gain:g}: {law.per_rad / law.gain:.6f} +- {law.se / law.gain:.6f} of full duty per rad "
              f"and unit; leaves {law.left:.4f}; cut off at {law.limit:.3g}")  # fmt: skip
    print("all runs:")
    begun = time.process_time()
    verdict = judged(model, logs)
    told(verdict, time.process_time() - begun)
    print(
        "\nPosition predicted from the commands, rms error over the motion's rms [%]: named, Coulomb and viscous alone"
    )
    every = []
    for gain in GAINS:
        others = [log for log in logs if log.drive.position_gain[0] != gain]
        laws = loop_laws(others)
        begun = time.process_time()
        verdict = judged(model, others)
        print(f"gain {gain} from the others:")
        told(verdict, time.process_time() - begun)
        found = verdict.by_the_others(len(verdict.trials))  # none of these is left out
        for log in (log for log in logs if log.drive.position_gain[0] == gain):
            every.append([share_left(own, verdict, laws, log) for own in (found, [plain(verdict)])])
            print(f"  {Path(log.name).stem:<28}" + "".join(f"{share:8.1f}" for share in every[-1]))
    print(f"\n  {'mean':<28}" + "".join(f"{share:8.1f}" for share in np.mean(every, axis=0)))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
