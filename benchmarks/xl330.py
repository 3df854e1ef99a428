"""A real position servo: its motor, its friction and its loop from the logs, and one gain foretold from the others.

    python benchmarks/xl330.py

Needs the published runs (``models/xl330/README.md`` says where they are from): put them into
``data/xl330`` or set MOCOBOT_XL330_DATA to their folder.
For every gain the runs of the other two are diagnosed; what is named there, and the loop's law, foretell the held-out
runs from their commands alone. Beside it a motor with the same torque constant and loop, whose Coulomb and viscous
friction are fitted to the same runs by least squares. Both are simulated by MuJoCo as the diagnosis does it.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from discrepancy.serial.diagnosis import diagnose_rig
from discrepancy.serial.laws.rig import LawfulSerialRig
from discrepancy.serial.rig import SerialRig
from discrepancy.serial.rolled.closed import LoopDrive
from discrepancy.serial.rolled.fitted import Fitted, extended, steps_per
from discrepancy.serial.rolled.free import compared
from discrepancy.serial.rolled.readings import Readings

from discrepancy.engine.explanation import Found
from discrepancy.joints.model import load_model, load_spec
from discrepancy.joints.servo.commanded import Servo, servo_of
from discrepancy.joints.servo.loop import LoopLaw, loop_laws
from mocobot.serial import read_logs
from mocobot_logs.joints.joint_log import JointLog
from mocobot_sim.serial.built import build
from mocobot_sim.serial.effects import RobotEffect
from mocobot_sim.serial.rollout import Start

VARIABLE = "MOCOBOT_XL330_DATA"
TOP = Path(__file__).resolve().parents[1]
FOLDER = TOP / "data" / "xl330"
GAINS = (100, 200, 400)


def named(rig: SerialRig) -> tuple[list[Found], list[str]]:
    """What a diagnosis names, and its words."""
    found = list(diagnose_rig(rig, laws="never").causes)
    return found, [item.candidate.cause for item in found]


def plain(rig: SerialRig) -> list[RobotEffect]:
    """Coulomb and viscous friction by least squares over samples that move."""
    left, right = [], []
    for part in rig.parts:
        s = part.signals
        at = s.usable[:, 0] & (np.abs(s.dq[:, 0]) > s.slow[0])
        left.append(np.column_stack([np.sign(s.dq[at, 0]), s.dq[at, 0]]))
        right.append((s.torque - s.inverse)[at, 0])
    coulomb, viscous = np.linalg.lstsq(np.concatenate(left), np.concatenate(right), rcond=None)[0]
    numbers = {"coulomb_Nm": max(float(coulomb), 0.0), "viscous_Nms_per_rad": max(float(viscous), 0.0)}
    return [RobotEffect("friction", 1, None, numbers)]


def share_left(robot: Fitted, rig: SerialRig, laws: Sequence[LoopLaw], log: JointLog) -> float:
    """Position error (rms) of the simulated loop under a log's commands, over the motion's standard deviation [%]."""
    servo = servo_of(log, 0, rig.motors, laws, rig.model.joints[0])
    assert isinstance(servo, Servo), servo
    drive = LoopDrive.of(log, [servo], robot.readings)
    every = steps_per(log.period_s)
    start = Start(0.0, log.q[0], np.zeros(1), np.zeros(1))
    error = compared(start, robot, drive, log.q, every, np.full(1, np.inf))
    return 100.0 * float(np.sqrt(np.mean(error**2)) / np.std(log.q[:, 0]))


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
    whole = LawfulSerialRig.of(model, logs)
    for wanted in ("never", "auto"):
        began = time.process_time()
        found = diagnose_rig(whole, laws=wanted)
        print(
            f"all runs, laws {wanted}: {found.verdict}, {time.process_time() - began:.1f} s of CPU; "
            f"{whole.motors[0].torque_per_unit:.4f} N m/V"
        )
        print(f"  foretold torques, share of the excess error removed: {found.gain and found.gain.removed()}")
        for item in found.causes:
            values, se = whole.effect_parameters(item.candidate, item.values, item.covariance)
            held = "" if item.held_out is None else f"; {100.0 * item.held_out:.1f} % held out"
            print(
                f"  {item.candidate.label}: "
                + ", ".join(f"{n} {v:.4g} +- {se[n]:.2g}" for n, v in values.items())
                + held
            )
    print(
        "\nPosition foretold from the commands, rms error over the motion's rms [%]: named, Coulomb and viscous alone"
    )
    for gain in GAINS:
        others = [log for log in logs if log.drive.position_gain[0] != gain]
        laws = loop_laws(others)
        rig = LawfulSerialRig.of(model, others)
        found, labels = named(rig)
        print(f"gain {gain} from the others: {', '.join(labels)}")
        for log in (log for log in logs if log.drive.position_gain[0] == gain):
            step_s = log.period_s / steps_per(log.period_s)
            robots = [
                extended(rig, found, step_s),
                Fitted(build(load_spec(model.path), plain(rig), step_s), Readings.of([], 1)),
            ]
            shares = [share_left(robot, rig, laws, log) for robot in robots]
            print(f"  {Path(log.name).stem:<28}" + "".join(f"{share:8.1f}" for share in shares))


if __name__ == "__main__":
    main()
