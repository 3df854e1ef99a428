"""``mocobot example``: files that are always the same, with a fault that MuJoCo confirms, and commands that run."""

from __future__ import annotations

import re
import shlex

import mujoco
import numpy as np
import pytest

from command import refused, run

FILES = {"arm.xml", "today.csv", "last_week.csv", "answer.txt"}
MOST_BYTES = 3_000_000


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with an example, and what the command prints."""
    from contextlib import redirect_stdout
    from io import StringIO

    from mocobot.cli import main

    folder = tmp_path_factory.mktemp("made") / "it's here"
    with redirect_stdout(StringIO()) as said:
        main(["example", "arm", "--out", str(folder)])
    return folder, said.getvalue()


def test_the_files_are_there_and_small(made):
    folder, said = made
    assert {path.name for path in folder.iterdir() if not path.name.startswith(".")} == FILES
    assert sum(path.stat().st_size for path in folder.iterdir()) < MOST_BYTES
    assert all(str(folder / name) in said for name in FILES)


def test_the_commands_can_be_pasted(made):
    """Also where the folder's name needs quotes; what they do is shown by the tutorial's test."""
    from mocobot.cli import parse

    folder, said = made
    lines = [shlex.split(line) for line in said.splitlines() if line.startswith("    mocobot ")]
    assert [words[1] for words in lines] == ["map", "diagnose", "diagnose", "calibrate"]
    assert all(parse(words[1:]).model == folder / "arm.xml" for words in lines)
    assert "--reference" in lines[2]


def test_an_example_is_always_the_same_and_not_overwritten(made, capsys):
    folder, _ = made
    before = {name: (folder / name).read_bytes() for name in FILES}
    assert "--force" in refused(capsys, "example", "arm", "--out", folder)
    assert run(capsys, "example", "arm", "--out", folder, "--force")[0] == 0
    assert {name: (folder / name).read_bytes() for name in FILES} == before


def test_the_fault_is_where_the_answer_says(made):
    """Torques beyond MuJoCo's inverse dynamics of the model, from the logged motion, in the direction of motion."""
    folder, _ = made
    answer = (folder / "answer.txt").read_text(encoding="utf-8")
    joint = re.findall(r"joint (\w+) is", answer)[0]
    true = {log: float(size) for size, log in re.findall(r"([\d.]+) N m in (\w+)", answer)}
    model = mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    data = mujoco.MjData(model)
    for log, wanted in true.items():
        time, q, dq, torque = np.split(
            np.loadtxt(folder / f"{log}.csv", delimiter=",", skiprows=1), (1, 7, 13), axis=1
        )
        ddq = np.gradient(dq, 0.005, axis=0)
        assert np.allclose(np.diff(time[:, 0]), 0.005, atol=1e-3)
        left = np.zeros_like(torque)
        for k in range(len(q)):
            data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
            mujoco.mj_inverse(model, data)
            left[k] = torque[k] - data.qfrc_inverse
        for j in range(model.njnt):
            moves = np.abs(dq[:, j]) > 0.1
            rubs = np.mean((left[:, j] * np.sign(dq[:, j]))[moves])
            own = wanted if model.joint(j).name == joint else model.dof_frictionloss[j]
            assert rubs == pytest.approx(own, rel=0.15), model.joint(j).name
