"""Pictures where the machine can render, one sentence where it cannot; and the scenarios that make them."""

import os
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mocobot_sim.base.solo import build_solo, compile_solo
from mocobot_view.camera import Camera, Marks
from mocobot_view.render import render
from rendering import made

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
VIEW = Camera((0.0, 0.0, 0.3), 2.0, 215.0, -30.0)


def test_without_a_renderer_there_is_a_sentence(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    words = render(compile_solo(build_solo()), [np.zeros(0)], VIEW)
    assert isinstance(words, str)
    assert words.startswith("pictures are skipped: MuJoCo cannot render without a screen here (disabled: ")
    assert "\n" not in words


def test_pictures_show_the_states_and_the_marks():
    model = compile_solo(build_solo())
    aside = model.qpos0.copy()
    aside[0] += 0.3
    marks = Marks()
    marks.path([[-0.5, -0.5, 0.01], [0.5, -0.5, 0.01], [0.5, 0.5, 0.01]], 0.02, (0.0, 0.8, 0.0, 1.0))
    marks.arrow([0.0, 0.0, 0.9], [0.0, 0.5, 0.9], 0.03, (0.0, 0.0, 1.0, 1.0))
    states = [model.qpos0, aside, model.qpos0]
    plain, moved, marked = made(render(model, states, VIEW, [Marks(), Marks(), marks], 320, 240))
    assert plain.shape == (240, 320, 3)
    assert np.abs(plain - moved).max() > 50
    for colour in (1, 2):
        others = [k for k in range(3) if k != colour]
        pure = lambda p, k=colour, o=others: (p[..., k] > 120) & (p[..., o].max(axis=-1) < 80)  # noqa: E731
        assert pure(marked).sum() > 50
        assert not pure(plain).any()


@pytest.mark.slow
def test_the_square_is_driven_without_any_opengl(tmp_path):
    done = subprocess.run(
        [sys.executable, str(SCENARIOS / "drive_square.py"), "--out", str(tmp_path), "--pace", "1"],
        env=os.environ | {"MUJOCO_GL": "disabled"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "kinematics with rollers" in done.stdout
    assert done.stdout.count("turn 360 deg") == 3
    assert "pictures are skipped" in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["drive_square.png"]


@pytest.mark.parametrize(
    ("name", "options", "sentence"),
    [
        ("carry_sideways.py", ("--payload", "z"), "payload 'z' does not exist"),
        ("guided_by_hand.py", ("--estimate", "nowhere.json"), "nowhere.json: not a usable estimate"),
        ("drive_square.py", ("--pace", "0"), "must last longer than 0 s"),
    ],
)
def test_scenarios_refuse_bad_input_in_one_sentence(tmp_path, monkeypatch, capsys, name, options, sentence):
    monkeypatch.setattr(sys, "argv", [name, *options, "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as stop:
        runpy.run_path(str(SCENARIOS / name), run_name="__main__")
    assert stop.value.code == 2
    assert sentence in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize(
    "name", sorted(path.name for path in SCENARIOS.glob("*.py") if "argparse" in path.read_text())
)
def test_scenarios_that_take_arguments_tell_of_them_and_write_nothing(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    with pytest.raises(SystemExit) as stop:
        runpy.run_path(str(SCENARIOS / name), run_name="__main__")
    assert stop.value.code == 0
    assert capsys.readouterr().out.startswith(f"usage: {name}")
    assert list(tmp_path.iterdir()) == []
