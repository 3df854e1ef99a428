"""Numbers that were changed in a simulation are named, with their values to a hundredth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from discrepancy.evidence.search import Chosen, Search, floor_of
from discrepancy.joints.diagnosed import JointDiagnosed
from discrepancy.joints.model import load_model
from discrepancy.joints.problem import joint_problem
from discrepancy.joints.trials import trials_of
from discrepancy.joints.unlisted import SIGNALS
from discrepancy.joints.verdict import JointVerdict, judged
from mocobot_logs.joints.joint_log import Drive, JointLog

Tolerances = Mapping[str, Mapping[str, float]]
RATE_HZ, STEP_S, SECONDS, NOISE, STEP = 250.0, 1e-3, 16.0, 1e-3, 1e-7
"""Of the logs: their rate, the simulation's step, noise of the torque over its size, and the encoder's step."""
SPRING = """<mujoco><option timestep="0.001" gravity="0 0 0"/><worldbody><body name="weight">
  <joint name="way" type="slide" axis="1 0 0" stiffness="10" damping="1"/>
  <geom type="box" size="0.1 0.1 0.1" mass="0.5"/></body></worldbody></mujoco>"""
CART = """<mujoco><option timestep="0.001"/><worldbody><body name="cart">
  <joint name="rail" type="slide" axis="1 0 0" damping="2"/><geom type="box" size="0.2 0.1 0.1" mass="5"/>
  <body name="pole" pos="0 0 0.1"><joint name="pin" axis="0 1 0" damping="0.05"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.6" size="0.02" mass="0.8"/></body></body></worldbody></mujoco>"""
ARM = """<mujoco><compiler angle="radian"/><option timestep="0.001"/><worldbody>
<body name="one" pos="0 0 0.1"><joint name="j1" axis="0 0 1" armature="0.05" damping="0.2"/>
  <inertial pos="0.03 0 0.05" mass="2" diaginertia="0.01 0.01 0.005"/>
<body name="two" pos="0 0 0.1"><joint name="j2" axis="0 1 0" armature="0.05" damping="0.2"/>
  <inertial pos="0.1 0 0.02" mass="1.5" diaginertia="0.004 0.01 0.01"/>
<body name="three" pos="0.25 0 0"><joint name="j3" axis="0 1 0" armature="0.02" damping="0.1"/>
  <inertial pos="0.1 0 0" mass="0.8" diaginertia="0.002 0.006 0.006"/>
</body></body></body></worldbody></mujoco>"""


def log_of(spec: mujoco.MjSpec, seed: int, size: float = 0.8) -> JointLog:
    """The joints of a model under computed torques along sums of sines, by the model itself."""
    model, rng = spec.compile(), np.random.default_rng(seed)
    data, J, t = mujoco.MjData(model), model.nv, STEP_S * np.arange(round(SECONDS / STEP_S))
    w = 2.0 * np.pi * rng.uniform(0.1, 1.2, (4, J))
    a, phase = rng.uniform(0.5, 1.0, (4, J)) / w, rng.uniform(0.0, 2.0 * np.pi, (4, J))
    turn = np.exp(1j * (w * t[:, None, None] + phase)) * a * size / a.sum(axis=0)
    x, x1, x2 = ((turn * (1j * w) ** n).imag.sum(axis=1) for n in range(3))
    data.qpos[:], data.qvel[:] = x[0], x1[0] - 0.5 * STEP_S * x2[0]
    inertia, log = np.zeros((J, J)), []
    for k in range(len(t)):
        mujoco.mj_step1(model, data)
        mujoco.mj_fullM(model, data, inertia)
        wanted = x2[k] + 40.0 * (x1[k] - data.qvel) + 400.0 * (x[k] - data.qpos)
        data.qfrc_applied[:] = inertia @ wanted + data.qfrc_bias - data.qfrc_passive
        log.append((data.qpos.copy(), data.qfrc_applied.copy()))
        mujoco.mj_step2(model, data)
    every = round(1.0 / RATE_HZ / STEP_S)
    q, torque = (np.array(part)[::every] for part in zip(*log, strict=True))
    q = np.round(q / STEP) * STEP
    torque += NOISE * np.std(torque, axis=0) * rng.standard_normal(torque.shape)
    none, one = np.full(J, np.nan), np.ones(J)
    drive = Drive(
        one, np.eye(J), one, np.zeros(J, dtype=bool), "none", none, none, "torque", np.full(J, np.inf)
    )
    names = tuple(model.joint(j).name for j in range(J))
    return JointLog(
        f"log {seed}", np.arange(len(q)) / RATE_HZ, RATE_HZ, q, torque, None, None, names, drive, np.full(J, STEP),
        np.ones(len(q), dtype=bool), RATE_HZ,
    )  # fmt: skip


def verdict_on(
    folder: Path, xml: str, change: Callable[[mujoco.MjSpec], None], tolerances: Tolerances | None = None
) -> JointVerdict:
    """What two logs of a changed model say of the model as it is written."""
    path = folder / "robot.xml"
    path.write_text(xml, encoding="utf-8")
    spec = mujoco.MjSpec.from_string(xml)
    change(spec)
    return judged(load_model(path), [log_of(spec, 1), log_of(spec, 2)], tolerances=tolerances)


def numbers(verdict: JointVerdict) -> dict[tuple[str, str, str], float]:
    """Values of all findings by cause, place and parameter."""
    return {
        (f.cause, m.place, n): x for f in verdict.findings for m in f.members for n, x in m.values.items()
    }


def geom_mass(place: int, mass: float) -> Callable[[mujoco.MjSpec], None]:
    def change(spec: mujoco.MjSpec) -> None:
        spec.geoms[place].mass = mass

    return change


def test_the_model_as_it_is(tmp_path: Path) -> None:
    for xml in (SPRING, CART):
        assert not verdict_on(tmp_path, xml, lambda spec: None).findings


def test_mass_on_a_spring(tmp_path: Path) -> None:
    """Twice the mass: of the link, or of a load on it, which one joint cannot tell apart."""
    verdict = verdict_on(tmp_path, SPRING, geom_mass(0, 1.0))
    (finding,) = verdict.findings
    assert finding.cause in ("payload", "link_mass")
    values = finding.members[0].values
    assert values.get("mass_kg", values.get("excess_kg")) == pytest.approx(0.5, rel=0.01)
    assert verdict.verdict == "explained"


def test_spring_and_damper(tmp_path: Path) -> None:
    def change(spec: mujoco.MjSpec) -> None:
        spec.joints[0].stiffness, spec.joints[0].damping = [15.0, 0.0, 0.0], [2.5, 0.0, 0.0]

    found = numbers(verdict_on(tmp_path, SPRING, change))
    assert {cause for cause, _, _ in found} == {"spring", "friction"}
    assert found["spring", "way", "stiffness_N_per_m"] == pytest.approx(5.0, rel=0.01)
    assert found["friction", "way", "viscous_Ns_per_m"] == pytest.approx(1.5, rel=0.01)


def test_cart_of_another_mass(tmp_path: Path) -> None:
    found = numbers(verdict_on(tmp_path, CART, geom_mass(0, 8.0)))
    assert set(found) == {("link_mass", "cart", "excess_kg")}
    assert found["link_mass", "cart", "excess_kg"] == pytest.approx(3.0, rel=0.01)


def test_pole_of_another_mass(tmp_path: Path) -> None:
    """Half as heavy again: less than what would be noticed beside a centre of mass that may be off by a tenth."""
    verdict = verdict_on(tmp_path, CART, geom_mass(1, 1.2))
    assert verdict.verdict == "consistent"
    (limit,) = [x for x in verdict.limits if (x.cause, x.place) == ("link_mass", "pole")]
    assert limit.sizes["excess_kg"] > 0.4
    known = {"link_com": dict.fromkeys(("x_m", "y_m", "z_m"), 1e-4), "link_mass": {"excess_kg": 0.01}}
    found = numbers(verdict_on(tmp_path, CART, geom_mass(1, 1.2), known | {"link_inertia": {"share": 0.01}}))
    assert {key[:2] for key in found} == {("link_mass", "pole")}
    assert found["link_mass", "pole", "excess_kg"] == pytest.approx(0.4, rel=0.01)


def test_link_of_another_mass_and_centre(tmp_path: Path) -> None:
    """Moments are products of the two: so far off, columns around the model's own numbers are not enough."""

    def change(spec: mujoco.MjSpec) -> None:
        link = spec.body("two")
        link.mass, link.ipos = 3.0, [0.15, 0.03, 0.02]

    found = numbers(verdict_on(tmp_path, ARM, change))
    assert {key[:2] for key in found} == {("link_mass", "two")}
    values = [found["link_mass", "two", n] for n in ("excess_kg", "x_m", "y_m", "z_m")]
    assert values == pytest.approx([1.5, 0.05, 0.03, 0.0], rel=0.02, abs=1e-3)


def test_a_link_that_is_called_as_another_links_joint(tmp_path: Path) -> None:
    def change(spec: mujoco.MjSpec) -> None:
        spec.body("j1").mass = 4.0

    verdict = verdict_on(tmp_path, ARM.replace('body name="two"', 'body name="j1"'), change)
    (finding,) = verdict.findings
    assert (finding.place, finding.joint) == ("j1", None)
    (told,) = JointDiagnosed(verdict, None).to_dict()["causes"]
    assert (told["place"], told["joint"]) == ("link j1", None)


def test_rotors_of_an_arm(tmp_path: Path) -> None:
    more = {"j1": 0.07, "j2": 0.04, "j3": 0.03}

    def change(spec: mujoco.MjSpec) -> None:
        for joint in spec.joints:
            joint.armature += more[joint.name]

    found = numbers(verdict_on(tmp_path, ARM, change))
    assert set(found) == {("armature", name, "armature_kgm2") for name in more}
    for name, value in more.items():
        assert found["armature", name, "armature_kgm2"] == pytest.approx(value, rel=0.01)


def test_a_joint_at_its_limits_is_no_cause(tmp_path: Path) -> None:
    """What pushes a joint back is left out with its time told; what else is wrong is found as before."""
    limited = ARM.replace('name="j2"', 'name="j2" range="-0.3 0.35"').replace(
        'name="j3"', 'name="j3" range="-0.4 0.4"'
    )
    verdict = verdict_on(tmp_path, limited, lambda spec: None)
    assert verdict.verdict == "consistent"
    assert [note for note in verdict.notes if "s of j2 at its limits" in note]

    def change(spec: mujoco.MjSpec) -> None:
        spec.joints[1].armature += 0.04

    found = numbers(verdict_on(tmp_path, limited, change))
    assert set(found) == {("armature", "j2", "armature_kgm2")}
    assert found["armature", "j2", "armature_kgm2"] == pytest.approx(0.04, rel=0.02)


def test_what_no_table_lists_goes_with_its_signal(tmp_path: Path) -> None:
    """An encoder whose disc is off its axis, and a torque sensor that reads some of its neighbour's."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM, encoding="utf-8")
    model, logs = load_model(path), [log_of(mujoco.MjSpec.from_string(ARM), seed) for seed in (1, 2)]

    def signal(change: Callable[[np.ndarray, np.ndarray], None]) -> tuple[str, str]:
        """Place and signal of the likeliest unlisted function."""
        read = [replace(log, q=log.q.copy(), torque=np.array(log.torque)) for log in logs]
        for log in read:
            change(log.q, np.asarray(log.torque))
        problem = joint_problem(model, trials_of(model, read).runs)
        search = Search(problem, floor_of(problem, problem.slabs()))
        groups = [c.group for _, c in search.offers(search.value((), None)) if c.group.late]
        return groups[0].place, list(SIGNALS)[int(dict(groups[0].shape)["signal"])]

    def disc(q: np.ndarray, torque: np.ndarray) -> None:
        q[:, 1] += 0.01 * np.sin(2.0 * q[:, 1] + 1.0)

    def neighbour(q: np.ndarray, torque: np.ndarray) -> None:
        torque[:, 1] += 0.1 * torque[:, 0]

    assert signal(disc) == ("j2", "reading")
    assert signal(neighbour) == ("j2", "neighbour's torque")


def test_tolerances_of_a_cause_that_is_left_out_swallow_nothing(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM, encoding="utf-8")
    spec = mujoco.MjSpec.from_string(ARM)
    spec.option.gravity = [1.0, 0.0, -9.76]
    verdict = judged(load_model(path), [log_of(spec, 1), log_of(spec, 2)], excluded=("gravity_direction",))
    assert verdict.verdict == "miscalibrated"
    assert [s.cause for s in verdict.scatter] == ["gravity_direction"]


def test_what_gives_way_to_gravity_is_no_error_of_a_reading_besides(tmp_path: Path) -> None:
    """An elastic joint is off by a function of its position, too: one excludes the other in a set."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM, encoding="utf-8")
    model, log = load_model(path), log_of(mujoco.MjSpec.from_string(ARM), 1)
    problem = joint_problem(model, trials_of(model, [log]).runs)
    search = Search(problem, floor_of(problem, problem.slabs()))
    (elastic, *_) = [g for g in problem.groups if g.cause == "elasticity"]
    state = search.value([Chosen(elastic, 1.0)], None)
    offered = {(g.place, list(SIGNALS)[int(dict(g.shape)["signal"])])
               for _, c in search.offers(state) if (g := c.group).cause == "unlisted"}  # fmt: skip
    assert (elastic.place, "reading") not in offered
    assert (elastic.place, "position") in offered
