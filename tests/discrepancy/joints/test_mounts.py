"""An arm that hangs from a ceiling or stands out of a wall while its model stands; logs made by MuJoCo."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from discrepancy.joints.diagnosed import JointDiagnosed, write_extended
from discrepancy.joints.model import SerialModel
from discrepancy.joints.mount import mount_of
from discrepancy.joints.trials import trials_of
from discrepancy.joints.verdict import judged
from serial_made import nominal, simulated, spec

MOUNTS = {
    "ceiling": ([0.0, 0.0, 9.81], "turned over, as on a ceiling"),
    "wall": ([0.0, 9.81, 0.0], "turned on its side, as on a wall"),
    "askew": ([4.0, -7.0, 5.617], "turned over, as on a ceiling|turned on its side|turned by"),
}


COULOMB_NM, VISCOUS_NMS = np.array([0.5, 0.5, 0.5, 0.1]), np.array([0.2, 0.2, 0.2, 0.04])


def rubs(q: np.ndarray, v: np.ndarray, torque: np.ndarray, time: float) -> np.ndarray:
    return COULOMB_NM * np.tanh(v / 1e-3) + VISCOUS_NMS * v


@pytest.fixture
def model(tmp_path: Path) -> SerialModel:
    return nominal(tmp_path)


@pytest.mark.parametrize("case", list(MOUNTS))
def test_another_mount_is_named_with_the_direction_of_gravity(tmp_path, model, case) -> None:
    gravity, said = MOUNTS[case]
    real = spec()
    real.option.gravity = gravity
    verdict = judged(model, [simulated(real.compile(), 3, rubs)])
    (found,) = (f for f in verdict.findings if f.cause == "gravity_direction")
    assert {f.cause for f in verdict.findings} == {"gravity_direction", "friction"}
    (member,) = found.members
    for axis, true in zip("xyz", gravity, strict=True):
        name = f"{axis}_m_per_s2"
        assert abs(member.values[name] - true) < max(4.0 * member.errors[name], 0.02)
        assert member.errors[name] < 0.2
    values = JointDiagnosed(verdict).values
    (cause,) = (c for c in values["causes"] if c["cause"] == "gravity_direction")
    assert any(f"The base is {words}" in cause["sentence"] for words in said.split("|"))
    turned = np.degrees(np.arccos(-gravity[2] / np.linalg.norm(gravity)))
    assert cause["name"].startswith(f"mount turned by {turned:.0f} deg")
    write_extended(verdict, tmp_path / "out")
    built = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "robot.xml"))
    np.testing.assert_allclose(built.opt.gravity, gravity, atol=0.2)


def lighter(model: mujoco.MjSpec) -> None:
    """Drives take nine tenths of the weight."""
    model.option.gravity = [0.0, 0.0, -0.981]


def leaning(model: mujoco.MjSpec) -> None:
    model.option.gravity = [9.81 * np.sin(0.3), 0.0, -9.81 * np.cos(0.3)]


def loaded(model: mujoco.MjSpec) -> None:
    model.body("hand").add_body(mass=4.0, ipos=[0.0, 0.1, 0.1], inertia=[0.02] * 3, explicitinertial=True)


@pytest.mark.parametrize("change", [lighter, leaning, loaded])
def test_what_else_pulls_is_no_other_mount(model, change) -> None:
    real = spec()
    change(real)
    trials = trials_of(model, [simulated(real.compile(), 4, rubs, seconds=8.0)])
    assert mount_of(trials.runs, range(4)) is None
