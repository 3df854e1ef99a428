"""A real position servo: its motor, its friction and its loop from the logs, and one gain foretold from the others.

    python benchmarks/xl330.py

Needs the published runs (``models/xl330/README.md`` says where they are from): put them into
``data/xl330`` or set MOCOBOT_XL330_DATA to their folder.
For every gain the runs of the other two are diagnosed; what is named there, and the loop's law, foretell the held-out
runs from their commands alone. Beside it a motor with the same torque constant and loop, whose Coulomb and viscous
friction are fitted to the same runs by least squares. Both are stepped alike, dry friction as an impulse.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from discrepancy.serial.diagnosis import diagnose_rig
from discrepancy.serial.laws.rig import LawfulSerialRig
from discrepancy.serial.model import SerialModel, load_model
from discrepancy.serial.recording.joint_log import JointLog
from discrepancy.serial.rig import SerialRig
from discrepancy.serial.servo.loop import loop_laws
from mocobot.serial import read_logs

VARIABLE = "MOCOBOT_XL330_DATA"
TOP = Path(__file__).resolve().parents[1]
FOLDER = TOP / "data" / "xl330"
GAINS = (100, 200, 400)
STEP_S = 5e-4


@dataclass(frozen=True)
class Servo:
    """Numbers of a servo: torques in N m at the joint, speeds in rad/s.

    Attributes:
        per_volt: torque at standstill.
        per_rad: duty per rad of error and unit of gain.
        coulomb, viscous, load_share, load: dry friction is coulomb + load_share (|load torque| - load).
        braking: torque lost to the speed while the drive is on.
        stribeck, fade: more dry friction near standstill.
        rotor: inertia beyond the model's.
        offset: of the torque.
    """

    per_volt: float
    per_rad: float
    coulomb: float = 0.0
    viscous: float = 0.0
    load_share: float = 0.0
    load: float = 0.0
    braking: float = 0.0
    stribeck: float = 0.0
    fade: float = 1.0
    rotor: float = 0.0
    offset: float = 0.0


def simulate(servo: Servo, model: SerialModel, log: JointLog) -> np.ndarray:
    """Positions under the log's commands [rad], shape (Q,)."""
    assert log.command is not None
    assert log.drive.supply_V is not None
    mass, lever = float(model.model.body_mass[-1]), float(-model.model.body_ipos[-1, 2])
    inertia = mass * lever**2 + float(model.model.body_inertia[-1, 1]) + servo.rotor
    weight, gain = mass * 9.81 * lever, float(log.drive.position_gain[0])
    q, v, a, out = float(log.q[0, 0]), 0.0, 0.0, np.empty(len(log.time))
    steps = round(log.period_s / STEP_S)
    dt = log.period_s / steps
    on = np.ones(len(log.time)) if log.enabled is None else log.enabled.astype(float)
    for k in range(len(out)):
        out[k] = q
        for _ in range(steps):
            duty = float(np.clip(servo.per_rad * gain * (log.command[k, 0] - q), -1.0, 1.0))
            drive = on[k] * (servo.per_volt * duty * log.drive.supply_V[k] - servo.braking * v)
            pull = weight * np.sin(q)
            dry = servo.coulomb + servo.load_share * (abs(pull + inertia * a) - servo.load)
            dry = max(dry + servo.stribeck * np.exp(-abs(v) / servo.fade), 0.0)
            free = v + dt * (drive - on[k] * servo.offset - pull - servo.viscous * v) / inertia
            new = float(np.sign(free) * max(abs(free) - dt * dry / inertia, 0.0))
            a, v = 0.5 * a + 0.5 * (new - v) / dt, new
            q += dt * v
    return out


def named(rig: SerialRig, per_rad: float) -> tuple[Servo, list[str]]:
    """A servo with what a diagnosis names, and the names."""
    servo = Servo(rig.motors[0].torque_per_unit, per_rad)
    labels = []
    for found in diagnose_rig(rig, laws="never").causes:
        values = dict(
            zip([p.name for p in found.candidate.parameters], map(float, found.values), strict=True)
        )
        shape = found.candidate.shape
        known = {
            "friction": lambda v, s: {
                "coulomb": v["coulomb_Nm"],
                "viscous": max(v["viscous_Nms_per_rad"], 0.0),
            },
            "load_friction": lambda v, s: {"load_share": v["share"], "load": s["load_Nm"]},
            "back_emf": lambda v, s: {"braking": v["braking_Nms_per_rad"]},
            "stribeck": lambda v, s: {"stribeck": v["excess_Nm"], "fade": s["fade_per_s"]},
            "armature": lambda v, s: {"rotor": v["armature_kgm2"]},
            "torque_offset": lambda v, s: {"offset": v["offset_Nm"]},
        }.get(found.candidate.cause)
        labels.append(found.candidate.cause + ("" if known else " (not stepped)"))
        servo = servo if known is None else replace(servo, **known(values, shape))
    return servo, labels


def plain(rig: SerialRig, start: Servo) -> Servo:
    """Coulomb and viscous friction by least squares over samples that move."""
    left, right = [], []
    for part in rig.parts:
        s = part.signals
        at = s.usable[:, 0] & (np.abs(s.dq[:, 0]) > s.slow[0])
        left.append(np.column_stack([np.sign(s.dq[at, 0]), s.dq[at, 0]]))
        right.append((s.torque - s.inverse)[at, 0])
    coulomb, viscous = np.linalg.lstsq(np.concatenate(left), np.concatenate(right), rcond=None)[0]
    return Servo(start.per_volt, start.per_rad, max(float(coulomb), 0.0), max(float(viscous), 0.0))


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
        full, labels = named(rig, float(np.mean([law.per_rad / law.gain for law in laws])))
        bare = plain(rig, full)
        print(f"gain {gain} from the others: {', '.join(labels)}")
        for log in (log for log in logs if log.drive.position_gain[0] == gain):
            size = float(np.std(log.q[:, 0]))
            shares = [100.0 * float(np.sqrt(np.mean((simulate(s, model, log) - log.q[:, 0]) ** 2))) / size
                      for s in (full, bare)]  # fmt: skip
            print(f"  {Path(log.name).stem:<28}{shares[0]:8.1f}{shares[1]:8.1f}")


if __name__ == "__main__":
    main()
