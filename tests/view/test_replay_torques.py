"""The replay of a robot of joints: torques as arrows at its joints, measured and with the causes of a diagnosis."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from command import refused, run
from joint_logs import write_csv
from made_arm import JOINTS, made, write_log
from mocobot.cli import main
from replay_case import Replayed


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> tuple[Path, dict[str, np.ndarray]]:
    """A folder with the log of an arm that rubs, and its diagnosis; the columns of the log."""
    folder, values = tmp_path_factory.mktemp("arm"), made(seconds=6.0)
    log = write_log(folder, values, "run 1.csv")
    write_csv(folder / "run 2.csv", made(seconds=2.0, seed=2))
    diagnosis = ("--model", folder / "arm.xml", "--out", folder / "v", "--no-closed-loop")
    main([str(word) for word in ("diagnose", log, *diagnosis)])
    return folder, values


@pytest.fixture(scope="module")
def replayed(arm) -> Replayed:
    folder, _ = arm
    words = ("--model", folder / "arm.xml", "--diagnosis", folder / "v", "--out", folder / "run.rrd")
    main([str(word) for word in ("replay", folder / "run 1.csv", *words)])
    return Replayed(folder / "run.rrd")


def arrows(replayed: Replayed, joint: str, which: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, origins and vectors."""
    (entity,) = [
        e for e in replayed.entities() if e.endswith(f"/torque/{joint}/{which}") and "/series/" not in e
    ]
    time, vectors = replayed.column(entity, "Arrows3D:vectors")
    _, origins = replayed.column(entity, "Arrows3D:origins")
    return time, origins, vectors


@pytest.mark.parametrize("joint", JOINTS)
def test_arrows_stand_where_mujoco_has_the_joints_and_are_as_long_as_the_torques(arm, replayed, joint):
    folder, values = arm
    model = mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))
    data, j = mujoco.MjData(model), model.joint(joint).id
    time, origins, vectors = arrows(replayed, joint, "measured")
    largest = np.max(np.abs(values[f"{joint} torque"]))
    length = np.max(np.linalg.norm(vectors, axis=1))
    for k in range(0, len(time), 37):
        at = int(np.argmin(np.abs(values["time"] - time[k])))
        data.qpos[:] = [values[f"{name} q"][at] for name in JOINTS]
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(origins[k], data.xanchor[j], atol=1e-4)
        share = values[f"{joint} torque"][at] / largest
        np.testing.assert_allclose(vectors[k] / length, share * data.xaxis[j], atol=0.06)


@pytest.mark.parametrize("joint", JOINTS)
def test_with_a_diagnosis_the_model_has_the_friction_that_it_lacked(arm, replayed, joint):
    _, values = arm
    series = {
        which: next(e for e in replayed.entities() if e.endswith(f"series/{joint}/torque/{which}"))
        for which in ("measured", "model", "corrected")
        if any(e.endswith(f"series/{joint}/torque/{which}") for e in replayed.entities())
    }
    assert set(series) == {"measured", "model", "corrected"}
    lines = {which: replayed.column(entity, "Scalars:scalars") for which, entity in series.items()}
    time, measured = lines["measured"][0], lines["measured"][1][:, 0]
    inside = (time > 0.5) & (time < values["time"][-1] - 0.5)
    off = {which: np.nanstd((lines[which][1][:, 0] - measured)[inside]) for which in ("model", "corrected")}
    assert off["corrected"] < 0.35 * off["model"]
    found, given = (
        np.linalg.norm(arrows(replayed, joint, which)[2], axis=1) for which in ("corrected", "measured")
    )
    middle = slice(len(found) // 6, -len(found) // 6)
    assert np.corrcoef(found[middle], given[middle])[0, 1] > 0.97


def test_what_does_not_belong_to_the_log_is_refused(arm, tmp_path, capsys):
    folder, _ = arm
    model = ("--model", folder / "arm.xml", "--out", tmp_path / "x.rrd")
    said = refused(capsys, "replay", folder / "run 2.csv", *model, "--diagnosis", folder / "v")
    assert "is a diagnosis of run 1, not of" in said
    assert said.endswith("leave --diagnosis out")
    assert run(capsys, "replay", folder / "run 2.csv", *model)[0] == 0
    other = tmp_path / "other.xml"
    other.write_text((folder / "arm.xml").read_text().replace('joint name="elbow"', 'joint name="wrist"'))
    (tmp_path / "log.toml").write_text((folder / "log.toml").read_text().replace('"elbow"]', '"wrist"]'))
    columns = {name.replace("elbow", "wrist"): values for name, values in made(seconds=2.0).items()}
    log = write_csv(tmp_path / "run 1.csv", columns)
    words = ("--model", other, "--diagnosis", folder / "v", "--out", tmp_path / "y.rrd")
    assert "is of a robot with the joints turret, shoulder, elbow; the model's are" in refused(
        capsys, "replay", log, *words
    )
    assert not (tmp_path / "y.rrd").exists()
