"""Several trials of one team, effects by their words, and robots from a file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import mocobot
from command import refused, run
from estimator.files import LIST
from mocobot_sim.effects.catalogue import EFFECTS, allowed

SHORT = ("--payload", "b", "--vias", 1, "--duration", 4)
PUSH = "push:trial=2,start=3,duration=1,force_z=-5"
BIAS = "sea_bias:robot=2,joint=3,bias=0.1"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A team of uncalibrated robots, one torque sensor more wrong than that, pushed in the second of its trials."""
    out = tmp_path_factory.mktemp("trials") / "new" / "trials"
    arguments = ["simulate", *SHORT, "--trials", "random,random,periodic", "--out-dir", out, "--effect", PUSH]
    mocobot_main([*arguments, "--effect", BIAS, "--preset", "uncalibrated", "--seed", 3])
    return out


def mocobot_main(arguments: list[object]) -> None:
    from mocobot.cli import main

    main([str(argument) for argument in arguments])


def test_every_trial_has_its_file_and_its_truth(folder):
    names = ["trial1_random", "trial2_random", "trial3_periodic"]
    assert sorted(p.name for p in folder.iterdir()) == sorted(
        [LIST, *(f"{name}.{end}" for name in names for end in ("parquet", "truth.json"))]
    )
    truths = [(folder / f"{name}.truth.json").read_bytes() for name in names]
    assert truths == truths[:1] * 3, "not one team"


def test_the_trials_are_those_of_one_team_simulated_one_by_one(folder):
    """The push is in the second alone, and the bias in all."""
    bias = mocobot.make_effect("sea_bias", {"bias_Nm": 0.1}, robot=2, joint=3)
    for name, kind, number, same in (
        ("trial1_random", "random", 0, True),
        ("trial2_random", "random", 1, False),
        ("trial3_periodic", "periodic", 0, True),
    ):
        length = {"vias": 1} if kind == "random" else {"duration_s": 4.0}
        alone = mocobot.simulate(
            "b", kind, preset="uncalibrated", seed=3, number=number, effects=[bias], **length
        )
        found = mocobot.read_recording(folder / f"{name}.parquet")
        np.testing.assert_array_equal(found.ref, alone.ref)
        assert np.array_equal(found.tau, alone.tau) is same, name


def test_robots_come_from_a_truth(folder, tmp_path, capsys):
    """Zeros, lengths and springs, those that effects have changed among them; the sensors are those asked for."""
    units, out = folder / "trial1_random.truth.json", tmp_path / "rec.parquet"
    code, said, _ = run(capsys, "simulate", *SHORT[:4], "--units", units, "--preset", "ideal", "--out", out)
    assert (code, "ideal sensors" in said) == (0, True)
    wanted, found = (json.loads(p.read_text()) for p in (units, out.with_suffix(".truth.json")))
    assert found["effects"] == []
    assert found["as_built"] == wanted["as_built"]
    assert np.abs(wanted["as_built"][1]["tau_zero_Nm"][2]) > 0.05, "the bias is in the robot"


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"as_built": [{"phi_zero_rad": [0.1, 0.0]}]}, "as_built[1]: phi_zero_rad is [0.1, 0.0]; it must be 3 finite"),
        ({"as_built": [{"rod_length_m": [0.0, 0.2, 0.0]}]}, "it must be from -0.05 to 0.05"),
        ({"as_built": [{"wrist_mass_ratio": -1.0}]}, "wrist_mass_ratio is -1.0; it must be from -0.9 to 10"),
        ({"as_built": [{"phi_zero": 1.0}]}, "unknown key 'phi_zero' (did you mean 'phi_zero_rad'?)"),
        ({"as_built": [{}]}, "as_built has 1 units; the payload has 3 grasps"),
    ],
)  # fmt: skip
def test_robots_that_cannot_be(tmp_path, capsys, values, sentence):
    file = tmp_path / "team.json"
    file.write_text(json.dumps(values))
    said = refused(capsys, "simulate", *SHORT[:4], "--units", file, "--out", tmp_path / "rec.parquet")
    assert sentence in said
    assert sorted(tmp_path.iterdir()) == [file]


def test_robots_are_drawn_or_given_but_not_both(folder, tmp_path, capsys):
    units = folder / "trial1_random.truth.json"
    arguments = ["--units", units, "--preset", "uncalibrated", "--out", tmp_path / "rec.parquet"]
    assert refused(capsys, "simulate", *arguments) == (
        "mocobot: preset 'uncalibrated' draws robots of its own, but units are given, which already say how its "
        "robots deviate; use ideal or nominal"
    )


def test_a_folder_is_replaced_if_asked_and_if_it_is_one_of_trials(folder, tmp_path, capsys):
    arguments = ["simulate", "--trials", "random,static", "--out-dir"]
    sentence = refused(capsys, *arguments, folder)
    assert sentence.endswith("is an earlier simulation; give --force to replace it, or name a new folder")
    (tmp_path / "mine.txt").write_text("mine")
    assert "exists and is not an earlier simulation" in refused(capsys, *arguments, tmp_path, "--force")
    assert "--trials is 'random,walk'; it must be a list such as" in refused(
        capsys, "simulate", "--trials", "random,walk", "--out-dir", tmp_path / "new"
    )


def test_effects_are_listed_with_units_and_ranges(capsys):
    code, out, err = run(capsys, "effects")
    assert (code, err) == (0, "")
    for name, kind in EFFECTS.items():
        assert f"\n{name}\n" in f"\n{out}"
        for each in allowed(kind):
            assert f"    {each.short:15}{each.unit:12}{each.range}" in out
    code, out, _ = run(capsys, "effects", "push", "drag")
    assert "given in {1} [m]" in " ".join(out.split())
    assert "joint_friction\n" not in out


def test_no_trials_are_none():
    with pytest.raises(mocobot.InputError, match="no trial given"):
        mocobot.simulate_trials("b", [])
    with pytest.raises(
        mocobot.InputError, match="duration_s is for a periodic trajectory; these are random, stat"
    ):
        mocobot.simulate_trials("b", ["random", "static"], duration_s=5.0)
