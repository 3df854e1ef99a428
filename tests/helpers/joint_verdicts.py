"""Verdicts on a small robot of joints, made up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from discrepancy.evidence.findings import Event, Finding, Limit, Member, Offer, Rival, Scatter
from discrepancy.joints.model import SerialModel, load_model
from discrepancy.joints.verdict import JointVerdict, Prediction
from discrepancy.result.traces import Trace

ROBOT = """<mujoco><worldbody>
<body name="base_link"><joint name="turn" axis="0 0 1"/>
  <inertial pos="0 0 0.1" mass="3" diaginertia="0.03 0.03 0.01"/>
<body name="arm" pos="0 0 0.2"><joint name="joint2" axis="0 1 0"/>
  <inertial pos="0.15 0 0" mass="2" diaginertia="0.01 0.04 0.04"/>
<body name="carriage" pos="0.35 0 0"><joint name="lift" type="slide" axis="0 0 1"/>
  <inertial pos="0.1 0 0" mass="1" diaginertia="0.003 0.01 0.01"/>
</body></body></body></worldbody></mujoco>"""
TRIALS = ("monday.csv", "tuesday.csv")
JOINTS = ("turn", "joint2", "lift")


def small_robot(folder: Path) -> SerialModel:
    """Two joints that turn, and one that slides."""
    path = folder / "robot.xml"
    path.write_text(ROBOT, encoding="utf-8")
    return load_model(path)


def member(place: str, joint: int | None, **values: float) -> Member:
    """With errors of 2 %."""
    return Member(place, joint, values, {name: 0.02 * abs(x) for name, x in values.items()})


def finding(cause: str, *members: Member, place: str = "", **more: Any) -> Finding:
    """At the place of its only member, or a kind."""
    alone = members[0] if len(members) == 1 else None
    where = place or (alone.place if alone else "all joints")
    given = {"probability": 0.97, "over_nothing": 180.0, "nothing": 0.0, "unlisted": 0.03, "folds": (80.0, 100.0),
             "in_sample": 0.4, "held_out": 0.38, "told": ((cause, where),)} | more  # fmt: skip
    joint = alone.joint if alone else more.get("joint")
    return Finding(**{"cause": cause, "place": where, "members": members} | given | {"joint": joint})


def friction_everywhere() -> Finding:
    return finding(
        "friction",
        member("turn", 1, coulomb_Nm=0.5, viscous_Nms_per_rad=0.3),
        member("joint2", 2, coulomb_Nm=0.7, viscous_Nms_per_rad=0.1),
        member("lift", 3, coulomb_N=12.0, viscous_Ns_per_m=4.0),
        probability=0.9996, unlisted=0.0004,
    )  # fmt: skip


def offset_or_spring() -> Finding:
    rivals = (Rival("spring", "joint2", 2, 0.3, 0.5), Rival("counterbalance", "joint2", 2, 0.04, 2.7))
    return finding(
        "torque_offset", member("joint2", 2, offset_Nm=0.21), probability=0.6, unlisted=0.06, rivals=rivals,
        told=(("torque_offset", "joint2"), ("spring", "joint2")),
    )  # fmt: skip


def a_payload() -> Finding:
    moments = {f"inertia_{axes}_kgm2": 1e-3 for axes in ("xx", "yy", "zz", "xy", "xz", "yz")}
    return finding("payload", member("carriage", None, mass_kg=1.4, x_m=0.2, y_m=-0.01, z_m=0.03, **moments))


def a_push() -> Finding:
    return finding(
        "push", member("carriage", None, x_N=4.0, y_N=0.5, z_N=-9.0), event=Event(1, 3.2, 0.25), held_out=None, folds=()
    )  # fmt: skip


def prediction(trial: str, better: bool) -> Prediction:
    before = np.array([0.8, 0.5, 9.0])
    noise = np.array([0.02, 0.02, 0.4])
    after = 1.02 * noise if better else before
    return Prediction(
        trial, before, after, noise, np.array([5.0, 9.0, 40.0]), 900.0, 1.05 if better else 900.0
    )  # fmt: skip


def traces() -> list[Trace]:
    """White noise after, ten times as much before."""
    out = []
    for k, name in enumerate(TRIALS):
        rng = np.random.default_rng(k)
        white, time = rng.standard_normal((400, 3)), np.arange(400) / 20.0
        sigma = np.tile([0.02, 0.02, 0.4], (400, 1))
        quantities = {
            "speed": np.abs(np.sin(time)),
            **{f"position of joint {j}": np.sin(j * time) for j in (1, 2, 3)},
        }
        out.append(
            Trace(
                name, time, 400, 20.0, 10 * white * sigma, white * sigma, sigma, 10 * white, white, quantities
            )
        )
    return out


def joint_verdict(folder: Path, findings: Sequence[Finding] = (), **more: Any) -> JointVerdict:
    """Explained by the findings, or consistent without any."""
    found = tuple(findings)
    offers = tuple(Offer(f.cause, f.place, f.joint, f.over_nothing) for f in found)
    verdict = JointVerdict(
        model=small_robot(folder), parts=(), measured=(0, 1, 2), trials=TRIALS, motors=(), reference=(),
        verdict="explained" if found else "consistent", findings=found, suspected=(), scatter=(),
        predictions=tuple(prediction(trial, bool(found)) for trial in TRIALS), validated=True,
        chi2_per_n=(900.0, 700.0, 1.05) if found else (1.2, 1.0, 1.0),
        before=offers, after=(Offer("ripple", "joint2", 2, 0.4),),
        limits=(
            Limit("torque_offset", "turn", 1, {"offset_Nm": 0.02}), Limit("link_mass", "arm", None, {"excess_kg": None})
        ),
        notes=("A note.",), finished=True, by_the_others=lambda trial: found, traces=traces,
    )  # fmt: skip
    return replace(verdict, **more)


def off_everywhere() -> Scatter:
    members = (
        member("joint2", 2, zero_rad=-0.031),
        member("turn", 1, zero_rad=0.02),
        member("lift", 3, zero_m=0.004),
    )
    return Scatter("joint_zero", 7.2, {"zero_rad": 0.003, "zero_m": 0.001}, members)
