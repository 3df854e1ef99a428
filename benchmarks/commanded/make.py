"""Write a set: a machine that logs commands and positions and no torque, its maker's wrong model, and the truth.

    python benchmarks/commanded/make.py leg 0 200 FOLDER --fault backlash

A folder has two logs to fit (``fit_0.csv``, ``fit_1.csv``) and one to forecast (``held_out.csv``), of 30 s each and of
different motions, their map ``log.toml``, the maker's ``model.xml``, and what nobody else may look at: ``true.xml`` and
``truth.json``.

Legs have drives with kp = 20 N m/rad and kd = 1.5 N m s/rad; commands are held for 20 or 10 ms in the median, in whole
rows; sets of odd seeds have friction laws of servos (M4 to M6), those of even seeds Coulomb and viscous friction; half
of the sets log speeds. Arms have servos of an STS3215's size: position loop at 1 kHz behind an encoder of 4096 steps,
duty, voltage, back-EMF; a command a row; a quarter of the sets Coulomb and viscous friction, the others M4 to M6.
Positions are stepped by MuJoCo: RK4 at 0.5 ms.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
import tyro

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # also runs as a file

from commanded.bodies import KINDS, add_play, spec_of, stand_of
from commanded.drives import ControlLaw, actuate
from commanded.machine import FIRMWARE_S, Machine, Run, late_at_servo, run
from commanded.motion import SECONDS, held, wished
from commanded.rubbing import LAWS, Law, law_of

Fault = Literal["backlash", "soft_stand", "half_gain", "friction_tripled", "extra_delay"]
RUNS = ("fit_0", "fit_1", "held_out")
WRONG, WRONG_MASS, GAIN = 3.0, 0.1, 0.02
"""Most that the maker's model is off: a factor either way, a share of a leg's masses; standard deviation of a drive's
torque constant from the told one, relative."""
LEG_KP, LEG_KD, LEG_MOST = 20.0, 1.5, np.array([23.7, 23.7, 45.43] * 2)
LEG_ARMATURE = np.array([0.010, 0.018, 0.036] * 2)
KT, OHM, VOLT, ARMATURE = 1.2116, 2.676, 7.4, 0.0284
"""An STS3215 at the joint: torque constant [N m/A], resistance, supply, rotor's inertia [kg m^2] (Rhoban/bam)."""
DUTY_PER_RAD, DUTY_MOST = 0.166, 0.97
"""Duty by error and firmware gain, and its limit (the same)."""
COUNTS = {"leg": 16384, "arm": 4096}
NOISE_RAD, NOISE_RADS = {"leg": 1e-4, "arm": 3e-4}, 0.02
"""Noise of positions before the encoder rounds them, and of logged speeds."""
LATE_S, MORE_S = {"leg": (0.002, 0.010), "arm": (0.003, 0.015)}, 0.020
PLAY_RAD = {"leg": (0.003, 0.006), "arm": (0.012, 0.022)}
SPEEDS = 24
"""Points of the curve of friction over speed."""


@dataclass
class _Drives:
    """Drives as they are, shape (J,) each: gains, limits; and the factor of the velocity gain that the map has."""

    kp: np.ndarray
    kd: np.ndarray
    most: np.ndarray
    armature: np.ndarray
    told_kd: np.ndarray


def _factor(rng: np.random.Generator, most: float, count: int) -> np.ndarray:
    return np.exp(np.log(most) * rng.uniform(-1.0, 1.0, count))


def _drives(kind: str, rng: np.random.Generator) -> _Drives:
    n = len(KINDS[kind].joints)
    if kind == "leg":
        kd = np.full(n, LEG_KD)
        return _Drives(np.full(n, LEG_KP), kd, LEG_MOST, LEG_ARMATURE * _factor(rng, 1.4, n), kd.copy())
    kt, ohm = KT * _factor(rng, 1.2, n), OHM * _factor(rng, 1.15, n)
    gain = float(rng.choice([16, 24, 32]))
    kd = kt**2 / ohm
    most = DUTY_MOST * VOLT * kt / ohm
    kp = gain * DUTY_PER_RAD * VOLT * kt / ohm
    return _Drives(kp, kd, most, ARMATURE * _factor(rng, 1.3, n), kd * _factor(rng, WRONG, n))


def _put(spec: mujoco.MjSpec, joints: tuple[str, ...], **numbers: np.ndarray) -> None:
    """Numbers of joints into a model: ``armature``, ``coulomb``, ``viscous``."""
    for j, name in enumerate(joints):
        joint = spec.joint(name)
        joint.armature, joint.frictionloss = numbers["armature"][j], numbers["coulomb"][j]
        joint.damping = [numbers["viscous"][j], 0.0, 0.0]


def _curve(law: Law, runs: list[Run]) -> dict[str, Any]:
    """Friction over speed, per joint: mean of what the law gives in the runs in bins of speed, without and with load.

    Bins reach from a hundredth of the 98th percentile of speeds to that percentile.
    """
    v, motor, outside = (np.vstack([getattr(r, n) for r in runs]) for n in ("dq", "torque", "outside"))
    speed = np.abs(v)
    dry = law.budget(motor, outside, v) + law.viscous * speed
    out: dict[str, Any] = {"speed_rads": [], "torque_Nm": [], "unloaded_Nm": [], "samples": []}
    for j in range(v.shape[1]):
        top = np.quantile(speed[:, j], 0.98)
        edges = np.linspace(0.01 * top, top, SPEEDS + 1)
        bin_of = np.digitize(speed[:, j], edges) - 1
        held = [bin_of == b for b in range(SPEEDS)]
        centre = np.array([speed[h, j].mean() if h.any() else np.nan for h in held])
        loaded = np.array([dry[h, j].mean() if h.any() else np.nan for h in held])
        bare = np.zeros((SPEEDS, v.shape[1]))
        bare[:, j] = np.nan_to_num(centre)
        unloaded = (law.budget(0.0 * bare, 0.0 * bare, bare) + law.viscous * bare)[:, j]
        keep = np.isfinite(centre)
        for name, value in zip(
            out, (centre, loaded, unloaded, np.array([h.sum() for h in held])), strict=True
        ):
            out[name].append(value[keep].tolist())
    return out


def _plain(law: Law, curve: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Coulomb and viscous friction that come nearest to the curve, shape (J,) each; not below 0."""
    if law.plain:
        return law.factor * law.base, law.viscous
    out = []
    for v, torque, many in zip(curve["speed_rads"], curve["torque_Nm"], curve["samples"], strict=True):
        weight = np.sqrt(np.array(many))
        A = np.column_stack([np.ones(len(v)), v]) * weight[:, None]
        coulomb, viscous = np.linalg.lstsq(A, np.array(torque) * weight, rcond=None)[0]
        out.append((max(coulomb, 1e-3), max(viscous, 1e-3)))
    coulomb, viscous = np.array(out).T
    return coulomb, viscous


def _table(path: Path, joints: tuple[str, ...], stamps: np.ndarray, columns: dict[str, np.ndarray]) -> None:
    names = ["time_s"] + [f"{joint}_{name}" for name in columns for joint in joints]
    np.savetxt(
        path,
        np.column_stack([stamps, *columns.values()]),
        delimiter=",",
        fmt="%.8g",
        header=",".join(names),
        comments="",
    )


def _map(kind: str, drives: _Drives, *, speeds: bool) -> str:
    """The log's map."""

    def numbers(x: np.ndarray) -> str:
        return "[" + ", ".join(f"{v:.6g}" for v in x) + "]"

    joints = ", ".join(f'"{n}"' for n in KINDS[kind].joints)
    damping = '"free"' if kind == "arm" else numbers(drives.told_kd)  # nobody knows a servo's back-EMF
    dq = 'dq = { column = "{joint}_velocity_rads", unit = "rad/s" }\n' if speeds else ""
    return (
        f'version = 1\njoints = [{joints}]\ntime = {{ column = "time_s", unit = "s" }}\n\n[channels]\n'
        f'q = {{ column = "{{joint}}_position_rad", unit = "rad" }}\n{dq}'
        'command = { column = "{joint}_command_rad", unit = "rad" }\n\n[control]\ncommand = "position"\n'
        f'gain_of = "torque"\nposition_gain = {numbers(drives.kp)}\nvelocity_gain = {damping}\n'
        f"limit = {numbers(drives.most)}\n"
    )


def make(
    kind: Literal["leg", "arm"],
    seed: int,
    rate_hz: float,
    folder: Path,
    fault: Fault | None = None,
    friction: str | None = None,
) -> None:
    """Write a set into ``folder``.

    Args:
        kind: machine.
        seed: of everything; the same seed gives the same machine with and without a fault, and at any rate.
        rate_hz: rate of the logs.
        folder: where to write.
        fault: what is wrong with the machine beside the wrong numbers.
        friction: law M1, M4, M5 or M6; by the seed without.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    own, joints = KINDS[kind], KINDS[kind].joints
    rng, maker, wish, read, harm, made = (
        np.random.default_rng([seed, len(kind), kind == "arm", k]) for k in range(6)
    )
    n = len(joints)
    if friction is None:
        friction = ("M1", LAWS[1 + seed // 2 % 3])[seed % 2] if kind == "leg" else LAWS[seed % 4]
    drives, rubs = _drives(kind, rng), law_of(kind, friction, rng)
    told = _Drives(drives.kp.copy(), drives.kd, drives.most, drives.armature, drives.told_kd)
    true = 1.0 + GAIN * made.standard_normal(n)
    drives.kp, drives.kd = drives.kp * true, drives.kd * true
    delay = rng.uniform(*LATE_S[kind])
    command_hz = float(rng.choice([50.0, 100.0])) if kind == "leg" else rate_hz

    hurt: dict[str, Any] = {}
    harmed, stand = int(harm.integers(n)), None
    if fault == "soft_stand":
        stand = stand_of(kind, harm)
        hurt = {"stiffness": stand[:, 0].tolist(), "damping": stand[:, 1].tolist()}
    elif fault == "half_gain":
        drives.kp[harmed] *= 0.5
    elif fault == "friction_tripled":
        rubs.factor[harmed] = 3.0
    elif fault == "extra_delay":
        delay += MORE_S
        hurt = {"more_s": MORE_S}
    spec = spec_of(kind, stand)
    if fault == "backlash":
        play = harm.uniform(*PLAY_RAD[kind])
        add_play(spec, joints[harmed], play)
        hurt = {"play_rad": play}
    if fault in ("backlash", "half_gain", "friction_tripled"):
        hurt["joint"] = joints[harmed]

    _put(spec, joints, armature=drives.armature, coulomb=rubs.factor * rubs.base, viscous=rubs.viscous)
    servo = kind == "arm"
    law = ControlLaw(drives.kp, drives.kd, drives.most, delay, servo)
    stepped = spec.copy()
    actuate(stepped, joints, law, firmware=servo)
    machine = Machine(stepped.compile(), joints, rubs, delay, servo, drives.kp, drives.most, COUNTS[kind])
    speeds, runs = kind == "leg" and seed // 2 % 2 == 1 and rate_hz <= 200.0, []
    fine = np.arange(0.0, SECONDS + 1e-3, 1e-3)
    stamps = np.arange(round(SECONDS * rate_hz) + 1) / rate_hz
    step = 2.0 * np.pi / COUNTS[kind]
    for which in RUNS:
        goal = wished(kind, own, which, fine, wish)
        at = held(stamps, rate_hz, command_hz, wish)
        command = np.column_stack([np.interp(stamps, fine, goal[:, j]) for j in range(n)])[at]
        if servo:
            command = step * np.round(command / step)
        ran = run(machine, stamps, command)
        low, high = own.range.T
        assert ((ran.q > low) & (ran.q < high)).all(), "a joint reaches its limit"
        q = step * np.round((ran.q + NOISE_RAD[kind] * read.standard_normal(ran.q.shape)) / step)
        columns = {"position_rad": q, "command_rad": command}
        if speeds:
            columns["velocity_rads"] = ran.dq + NOISE_RADS * read.standard_normal(ran.q.shape)
        _table(folder / f"{which}.csv", joints, stamps, columns)
        runs.append(ran)

    curve = _curve(rubs, runs[:2])
    coulomb, viscous = _plain(rubs, curve)
    _put(spec, joints, armature=drives.armature, coulomb=coulomb, viscous=viscous)
    # A firmware that holds for a period is half of it late; true where its limit is not reached.
    acts = drives.kd - 0.5 * FIRMWARE_S * drives.kp if servo else drives.kd
    actuate(spec, joints, replace(law, kd=acts))
    spec.compile()
    (folder / "true.xml").write_text(spec.to_xml(), encoding="utf-8")
    (folder / "model.xml").write_text(_makers(kind, drives, coulomb, viscous, maker), encoding="utf-8")
    (folder / "log.toml").write_text(_map(kind, told, speeds=speeds), encoding="utf-8")
    truth = {
        "kind": kind, "seed": seed, "rate_hz": rate_hz, "law": friction, "command_hz": command_hz,
        "integrator": "RK4, 0.5 ms", "counts_per_turn": COUNTS[kind], "noise_rad": NOISE_RAD[kind],
        "bus_delay_s": delay, "fault": fault and {"name": fault, **hurt},
        "joints": {
            name: {
                "armature_kgm2": drives.armature[j], "coulomb_Nm": coulomb[j], "viscous_Nms_per_rad": viscous[j],
                "kp": drives.kp[j], "kd": drives.kd[j], "limit_Nm": drives.most[j],
                "delay_s": late_at_servo(stamps, delay) if servo else delay,
                "loop_delay_s": 0.5 * FIRMWARE_S if servo else 0.0,
                "friction": {key: value[j] for key, value in curve.items()},
            }
            for j, name in enumerate(joints)
        },
        "told": {"kp": told.kp.tolist(), "kd": (told.told_kd * (kind == "leg")).tolist(), "limit": told.most.tolist()},
        "masses": {b.name: b.mass for b in spec.bodies[2:]},
        "friction_law": rubs.to_json(),
    }  # fmt: skip
    (folder / "forecast.json").unlink(missing_ok=True)  # what score.py keeps of an earlier set
    (folder / "truth.json").write_text(json.dumps(truth, indent=1), encoding="utf-8")


def _makers(
    kind: str, drives: _Drives, coulomb: np.ndarray, viscous: np.ndarray, rng: np.random.Generator
) -> str:
    """The maker's model: gravity and lengths right, all else off."""
    spec, joints = spec_of(kind), KINDS[kind].joints
    n = len(joints)
    _put(
        spec, joints, armature=drives.armature * _factor(rng, WRONG, n), coulomb=coulomb * _factor(rng, WRONG, n),
        viscous=viscous * _factor(rng, WRONG, n),
    )  # fmt: skip
    for body in spec.bodies[2:] if kind == "leg" else ():
        share = 1.0 + rng.uniform(-WRONG_MASS, WRONG_MASS)
        body.mass, body.inertia = body.mass * share, np.array(body.inertia) * share
    for j, name in enumerate(joints):
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.ctrlrange = [-drives.most[j], drives.most[j]]
        motor.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE
    spec.compile()
    return spec.to_xml()


if __name__ == "__main__":
    tyro.cli(make, description=__doc__)
