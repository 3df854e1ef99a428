"""The EMPS axis as a robot with one slide: MATLAB file, shipped map, and what the engine finds in its recordings."""

from __future__ import annotations

import os
import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

import command
from discrepancy.evidence.probability import odds_of
from discrepancy.joints.diagnose import Outcome, diagnose, labels_of
from mocobot import serial

ROOT = Path(__file__).resolve().parents[2]
MODEL = ROOT / "models" / "emps" / "emps.xml"
DATA = Path(os.environ.get("MOCOBOT_EMPS_DATA") or ROOT / "data" / "emps")
SCENARIO = runpy.run_path(str(ROOT / "scenarios" / "emps.py"))
GAIN, KP, KV = (SCENARIO[name] for name in ("GAIN_N_PER_V", "KP_PER_S", "KV_VS_PER_M"))
COULOMB, VISCOUS = "axis coulomb_Nm", "axis viscous_Nms_per_rad"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of an axis with the published mass and friction."""
    path = tmp_path_factory.mktemp("emps") / "made.mat"
    SCENARIO["simulate"](path)
    return path


def found(path: Path) -> Outcome:
    model = serial.read_model(MODEL)
    return diagnose(model, serial.read_logs(path, model))


def test_the_shipped_map_reads_a_recording(made: Path) -> None:
    (log,) = serial.read_logs(made, serial.read_model(MODEL))
    raw = {name: values.ravel() for name, values in loadmat(made).items() if not name.startswith("__")}
    assert (log.rate_hz, log.joints) == (1000.0, ("axis",))
    assert log.usable.all()
    assert np.array_equal(log.q[:, 0], raw["qm"])
    assert log.command is not None
    assert np.array_equal(log.command[:, 0], raw["qg"])
    assert log.torque is not None
    np.testing.assert_allclose(log.torque[:, 0], GAIN * raw["vir"], rtol=1e-14)
    drive = log.drive
    assert (drive.command, drive.gain_of) == ("position", "torque")
    numbers = [drive.position_gain[0], drive.velocity_gain[0], drive.limit[0]]
    np.testing.assert_allclose(numbers, [GAIN * KV * KP, GAIN * KV, 10.0 * GAIN], rtol=1e-12)


def test_a_recording_is_ready(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = command.run(capsys, "inspect", made, "--model", MODEL, "--strict")
    assert (code, err) == (0, "")
    assert "ready for: a diagnosis from torques of 1 joint and one from commands" in out


def test_friction_of_a_simulated_axis_is_found_and_nothing_else_is_sure(made: Path) -> None:
    outcome = found(made)
    sure = [o.chosen.group.key for o in odds_of(outcome.search, outcome.state) if o.probability >= 0.9]
    assert sure == [("friction", "axis")]
    values = labels_of(outcome)
    assert values[COULOMB][0] == pytest.approx(SCENARIO["COULOMB_N"], rel=0.05)
    assert values[VISCOUS][0] == pytest.approx(SCENARIO["VISCOUS_NS_PER_M"], rel=0.05)


@pytest.mark.parametrize("name", ["DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"])
def test_friction_of_the_real_axis_is_found(name: str) -> None:
    if not (DATA / name).is_file():
        pytest.skip("the EMPS benchmark's recordings are not here; set MOCOBOT_EMPS_DATA to their folder")
    outcome = found(DATA / name)
    assert {("friction", "axis"), ("asymmetric_viscous", "axis")} <= outcome.state.keys
    values = labels_of(outcome)
    assert values[COULOMB][0] == pytest.approx(20.4, rel=0.2)
    assert values[VISCOUS][0] == pytest.approx(203.5, rel=0.1)
    assert values["axis asymmetry_Nms_per_rad"][0] == pytest.approx(-39.5, abs=6.0)
