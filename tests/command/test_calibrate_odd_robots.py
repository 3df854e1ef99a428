"""``calibrate --model`` of a wrist with coupled drives, of a log of rest, and of what MJCF cannot hold."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import mocobot
from command import run
from made_arm import JOINTS, MAP, MODEL, made, write_log, write_map
from mocobot.api.calibration import JointCalibration

COUPLED = "[drive]\ncoupling.elbow = { shoulder = 1 }\n"
DRY_NM, VISCOUS_NMS = 0.8, 0.4
FORE = '<inertial mass="2" pos="0.02 0 0.15" diaginertia="0.02 0.02 0.005"/>'
AT_END = '<geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03" mass="0"/>'
"""Numbers of the fore arm."""


@pytest.fixture(scope="module")
def values() -> dict[str, np.ndarray]:
    return made(seconds=8.0)


def with_rubbing_motor(values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The motor of the elbow turns with the sum of shoulder and elbow, and rubs."""
    speed = values["elbow dq"] + values["shoulder dq"]
    more = DRY_NM * np.tanh(speed / 0.01) + VISCOUS_NMS * speed
    return values | {f"{joint} torque": values[f"{joint} torque"] + more for joint in ("shoulder", "elbow")}


def written(folder: Path, values: dict[str, np.ndarray], model: str = MODEL, drives: str = COUPLED) -> Path:
    log = write_log(folder, values)
    (folder / "arm.xml").write_text(model, encoding="utf-8")
    write_map(folder, MAP + drives)
    return log


def as_found(found: JointCalibration, folder: Path) -> mujoco.MjModel:
    found.write(folder, pictures=False)
    return mujoco.MjModel.from_xml_path(str(folder / "as_found.xml"))


@pytest.mark.parametrize("rubs", [True, False])
def test_a_coupled_drive_stands_in_the_model_as_found(tmp_path, values, rubs) -> None:
    log = written(tmp_path, with_rubbing_motor(values) if rubs else values)
    model = as_found(mocobot.calibrate(log, tmp_path / "arm.xml"), tmp_path / "found")
    drive = model.tendon("drive_of_2_and_3").id
    assert model.tendon_frictionloss[drive] == pytest.approx(DRY_NM * rubs, abs=0.1)
    assert model.tendon_damping.reshape(model.ntendon, -1)[drive, 0] == pytest.approx(
        VISCOUS_NMS * rubs, abs=0.05
    )
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0, 0.3, -0.1
    mujoco.mj_forward(model, data)
    assert data.ten_length[drive] == pytest.approx(0.2)


def test_a_model_as_found_can_be_calibrated_again(tmp_path, values) -> None:
    log = written(tmp_path, with_rubbing_motor(values))
    first = as_found(mocobot.calibrate(log, tmp_path / "arm.xml"), tmp_path / "found")
    again = mocobot.calibrate(log, tmp_path / "found" / "as_found.xml", map=tmp_path / "log.toml")
    second = as_found(again, tmp_path / "again")
    assert second.ntendon == 1
    for name in ("tendon_frictionloss", "tendon_damping", "dof_frictionloss", "dof_damping"):
        np.testing.assert_allclose(getattr(second, name), getattr(first, name), atol=0.02)


@pytest.mark.parametrize("rotors", [(1.39, 0.88, 0.08), (2.49, 2.02, 0.92), (1.63, 2.82, 1.16)])
def test_rotors_that_the_arm_lacks_are_zero_and_links_stay_bodies(tmp_path, values, rotors) -> None:
    """Torques fall with acceleration, so rotors end at their bound and links become as slender as bodies can be."""
    model, own = MODEL, dict(values)
    for joint, rotor in zip(JOINTS, rotors, strict=True):
        given = f'<joint name="{joint}" armature="{rotor}" frictionloss="{10 * rotor}"'
        model = model.replace(f'<joint name="{joint}"', given)
        smooth = np.convolve(values[f"{joint} q"], np.ones(9) / 9.0, "same")
        own[f"{joint} torque"] = values[f"{joint} torque"] - 0.5 * np.gradient(
            np.gradient(smooth, 0.004), 0.004
        )
    found = mocobot.calibrate(written(tmp_path, own, model), tmp_path / "arm.xml")
    sizes = [
        p.value for p in found.found.parameters if p.name.split("_")[0] in ("armature", "coulomb", "viscous")
    ]
    assert min(sizes) >= 0.0
    built = as_found(found, tmp_path / "found")
    assert built.dof_armature == pytest.approx(0.0, abs=1e-12)
    second = 0.5 * built.body_inertia[1:].sum(axis=1, keepdims=True) - built.body_inertia[1:]
    assert np.all(second.min(axis=1) > 9e-4 * second.max(axis=1))  # more than the digits of a file round off


def test_a_log_of_rest_determines_nothing_of_the_model(tmp_path, values) -> None:
    rng = np.random.default_rng(1)
    still = {name: np.full_like(x, x[100]) for name, x in values.items()} | {"time": values["time"]}
    for joint in JOINTS:
        still[f"{joint} dq"][:] = 0.0
        still[f"{joint} torque"] += 0.05 * rng.standard_normal(len(values["time"]))
    found = mocobot.calibrate(written(tmp_path, still, drives=""), tmp_path / "arm.xml")
    assert not [p for p in found.found.parameters if p.determined and p.in_model]
    assert "No joint moves in these logs; they tell no friction and no inertia" in str(found)
    given = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    assert as_found(found, tmp_path / "found").body_mass == pytest.approx(given.body_mass, rel=1.0)


def test_a_link_without_mass_is_named_and_kept(tmp_path, values) -> None:
    light = MODEL.replace(FORE, '<inertial mass="1e-9" pos="0 0 0" diaginertia="1e-12 1e-12 1e-12"/>')
    found = mocobot.calibrate(written(tmp_path, values, light, ""), tmp_path / "arm.xml")
    assert (
        "Link fore has no mass in the model, so its inertial parameters are not fitted." in found.found.notes
    )
    assert "fore" not in {p.place for p in found.found.parameters}
    assert as_found(found, tmp_path / "found").body("fore").mass[0] == pytest.approx(1e-9)


def test_an_effect_that_mjcf_cannot_hold_is_said(tmp_path, capsys, values) -> None:
    """The friction that the elbow lacks is that of a finger that follows it, so its own would be negative."""
    finger = (
        '<body name="tip" pos="0 0 0.3"><inertial mass="0.1" pos="0 0 0.02" diaginertia="1e-4 1e-4 1e-4"/>'
        '<joint name="tip" axis="0 1 0" frictionloss="5"/></body>'
    )
    follows = '<equality><joint joint1="tip" joint2="elbow" polycoef="0 -1 0 0 0"/></equality></mujoco>'
    log = written(tmp_path, values, MODEL.replace(AT_END, finger).replace("</mujoco>", follows), "")
    out = tmp_path / "found"
    code, said, _ = run(capsys, "calibrate", log, "--model", tmp_path / "arm.xml", "--out", out)
    assert code == 0
    as_given = (
        "as_found.xml leaves friction in joint 3 (elbow) as given: MJCF cannot hold what parameters.csv has."
    )
    assert f"But {as_given}" in said
    assert as_given in " ".join((out / "report.txt").read_text(encoding="utf-8").split())
