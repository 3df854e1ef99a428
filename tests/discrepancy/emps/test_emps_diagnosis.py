"""The axis diagnosed: hidden causes named, extended, gained; nothing named where nothing is wrong; the command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from diagnose_run import refused, run
from discrepancy.emps.causes import CAUSES
from discrepancy.emps.causes.base import Cause
from discrepancy.emps.diagnosis import also_fitted, diagnose_axis
from discrepancy.emps.rig import EmpsRig
from discrepancy.emps.staircase import format_staircase, staircase
from discrepancy.emps.words import EmpsWords
from discrepancy.engine.diagnose import Diagnosis
from discrepancy.result.traces_file import load_traces
from emps_made import nominal, recorded, written
from mocobot_sim.emps.extended import load_plant
from mocobot_sim.emps.plant import Plant, PulseTrain

RUBBING = replace(nominal(), mass_kg=95.0, coulomb_N=(20.0, 20.0), viscous_Ns_per_m=(160.0, 240.0))
TRAIN = PulseTrain(0.3, 0.7, 0.3, 2.0)
PULSED = replace(nominal(), coulomb_N=(15.0, 15.0), voltage_pulses=(TRAIN,))


def diagnosed(plant: Plant) -> tuple[EmpsRig, Diagnosis]:
    rig = EmpsRig.of(recorded(plant))
    return rig, diagnose_axis(rig, closed_loop=False)


def named(diagnosis: Diagnosis) -> dict[str, np.ndarray]:
    return {item.candidate.cause: item.values for item in diagnosis.causes}


@pytest.fixture(scope="module")
def rubbing() -> tuple[EmpsRig, Diagnosis]:
    return diagnosed(RUBBING)


def test_every_cause_has_a_sentence() -> None:
    for cause in CAUSES.values():
        assert type(cause).sentence is not Cause.sentence, cause.name


@pytest.mark.slow
def test_friction_is_named_with_its_size(rubbing: tuple[EmpsRig, Diagnosis]) -> None:
    rig, diagnosis = rubbing
    found = named(diagnosis)
    # Rest at the turns is modelled up to chi2/n 2.6 of 3740, which is more than noise.
    assert diagnosis.verdict == "partly_explained"
    assert set(found) == {"coulomb_friction", "viscous_friction", "asymmetric_viscous", "mass"}
    assert found["coulomb_friction"][0] == pytest.approx(20.0, abs=0.3)
    assert found["viscous_friction"][0] == pytest.approx(200.0, abs=3.0)
    assert found["asymmetric_viscous"][0] == pytest.approx(-40.0, abs=1.0)
    # Where the axis turns round, dry friction keeps it at rest; that costs the mass 0.3 %.
    assert found["mass"][0] == pytest.approx(-5.0, abs=0.5)
    for item in diagnosis.causes:
        assert np.sqrt(item.covariance[0, 0]) < 0.05 * max(abs(item.values[0]), 1.0)
    also = also_fitted(rig, diagnosis.explanation, ("position_gain", "injected_voltage"))
    assert abs(also["position_gain"][0]) < 0.05
    assert abs(also["injected_voltage"][0]) < 5e-3
    assert any("No pulses" in note for note in diagnosis.notes)
    assert any("3 cycles of the same motion" in note for note in diagnosis.notes)


@pytest.mark.slow
def test_causes_improve_the_response_on_blocks_they_were_not_fitted_to(
    rubbing: tuple[EmpsRig, Diagnosis],
) -> None:
    rig, diagnosis = rubbing
    steps = staircase(rig, diagnosis.explanation)
    assert [s.cause for s in steps] == ["nominal", *(f.candidate.cause for f in diagnosis.causes)]
    for first, last in ((steps[0].in_sample, steps[-1].in_sample), (steps[0].held_out, steps[-1].held_out)):
        assert last.force_percent < 0.1 * first.force_percent
        assert last.position_um < 0.1 * first.position_um
        assert last.voltage_mV < 0.1 * first.voltage_mV
    table = format_staircase(steps)
    assert len(table.splitlines()) == 2 + len(steps)
    assert max(map(len, table.splitlines())) <= 100


@pytest.mark.slow
def test_nothing_is_named_where_nothing_is_wrong() -> None:
    rig = EmpsRig.of(recorded(nominal()))
    diagnosis = diagnose_axis(rig)
    assert diagnosis.verdict == "consistent"
    assert not diagnosis.causes
    assert diagnosis.gain is not None
    assert diagnosis.gain.before == diagnosis.gain.after


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "cause", "other"),
    [
        (PULSED, "injected_voltage", "injected_force"),
        (replace(nominal(), coulomb_N=(15.0, 15.0), force_pulses=(replace(TRAIN, size=20.0),)),
         "injected_force", "injected_voltage"),
    ],
    ids=["in the loop", "on the carriage"],
)  # fmt: skip
def test_pulses_are_named_where_they_enter(plant: Plant, cause: str, other: str) -> None:
    _, diagnosis = diagnosed(plant)
    found = {item.candidate.cause: item for item in diagnosis.causes}
    assert cause in found
    assert other not in found
    assert found[cause].values[0] == pytest.approx(2.0 if cause == "injected_voltage" else 20.0, rel=0.01)
    shape = found[cause].candidate.shape
    assert (shape["start_s"], shape["period_s"], shape["width_s"]) == pytest.approx(
        (0.3, 0.7, 0.3), abs=1.1e-3
    )


@pytest.mark.slow
def test_no_verdict_hangs_on_the_last_digits() -> None:
    """Rounding decides between trains of force that fit equally where no force acts in pulses; none may be named."""
    log, rng = recorded(PULSED), np.random.default_rng(0)
    position, voltage = (x * (1.0 + 1e-12 * rng.standard_normal(len(x))) for x in (log.position, log.voltage))
    disturbed = replace(log, position=position, voltage=voltage)
    first, other = (diagnose_axis(EmpsRig.of(x), closed_loop=False) for x in (log, disturbed))
    assert other.verdict == first.verdict
    assert list(named(other)) == list(named(first)) == ["injected_voltage", "coulomb_friction"]
    assert other.explanation.after == pytest.approx(first.explanation.after, rel=1e-5)


@pytest.mark.slow
def test_offset_and_uneven_dry_friction_are_not_told_apart() -> None:
    """One of the two is named; that the other would do as well while it slides is said with what would decide it."""
    plant = replace(nominal(), coulomb_N=(15.0, 15.0), resisting_N=3.0)
    _, diagnosis = diagnosed(plant)
    pair = {"force_offset", "asymmetric_coulomb"}
    (index,) = (k for k, item in enumerate(diagnosis.causes) if item.candidate.cause in pair)
    item = diagnosis.causes[index]
    assert item.values[0] == pytest.approx(3.0, abs=0.1)
    # Friction at the turns comes in pulses, too, but in step with the motion.
    assert "injected_force" not in named(diagnosis)
    (rival,) = (c for c, _ in item.rivals if c.cause in pair)
    assert {rival.cause, item.candidate.cause} == pair
    assert "breaks loose" in EmpsWords().separate(rival)


# The command.


@pytest.mark.slow
def test_command_shows_names_extends_and_measures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = written(tmp_path, recorded(RUBBING)), tmp_path / "verdict"
    code, text, _ = run(capsys, "--rig", "emps", path, "--out", out, "--jobs", 1)
    values = json.loads((out / "diagnosis.json").read_text())
    words = " ".join(text.split())
    assert code == 0
    assert text.startswith("PARTLY EXPLAINED. Axis: rubs with ")
    assert "remains of 3740, where up to 1.15 is clean" in words
    assert "the drive's gain (force per volt) against the mass" in words
    assert "a known weight on the carriage" in words
    # A hysteresis within 4 um of a turn fits what smoothed velocities leave there; no such friction was simulated.
    assert {c["cause"] for c in values["causes"]}.isdisjoint({"law"})
    assert "makes the response to the commands worse" in words
    assert "kp = 160.1" in words
    assert {c["place"] for c in values["causes"]} == {"axis"}
    assert values["gain"]["units"] == {"position": "m", "voltage": "V"}
    assert values["gain"]["validated"]
    assert len(values["recordings"]) == 3
    pictures = {p.name for p in out.glob("*.png")}
    assert {"residual_against.png", "evidence.png", "closed_loop.png"} < pictures
    assert len(pictures) == 6
    assert (out / "report.txt").read_text().strip() in text
    traces, channels = load_traces(out / "residuals.npz")
    assert ([trace.name for trace in traces], len(channels)) == (values["recordings"], 2)
    assert [entry["path"] for entry in values["provenance"]["files"]] == [str(path)]
    assert values["provenance"]["options"]["rig"] == "emps"
    model = mujoco.MjModel.from_xml_path(str(out / "extended" / "axis.xml"))
    assert model.dof_frictionloss[0] == pytest.approx(20.0, abs=0.3)
    assert model.dof_damping[0] == pytest.approx(160.0, abs=3.0)
    assert load_plant(out / "extended").viscous_Ns_per_m[1] == pytest.approx(240.0, abs=3.0)
    held_out = values["gain"]["held_out"]
    for channel in ("position", "voltage"):
        assert held_out["after"][f"{channel}_rms"] < 0.05 * held_out["before"][f"{channel}_rms"]


def test_command_refuses_in_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = written(tmp_path, recorded(nominal()))
    other = written(tmp_path, recorded(nominal(), name="other.mat"))
    out = tmp_path / "verdict"
    assert "takes one" in refused(capsys, "--rig", "emps", good, other)
    assert "'wobble' does not exist" in refused(capsys, "--rig", "emps", good, "--exclude", "wobble")
    assert "no such file" in refused(capsys, "--rig", "emps", tmp_path / "none.mat", "--out", out).lower()
    flipped = written(
        tmp_path, replace(recorded(RUBBING), name="flipped.mat"), vir=-recorded(RUBBING).voltage
    )
    assert "drives the axis backwards" in refused(capsys, "--rig", "emps", flipped, "--out", out)
    (tmp_path / "t.toml").write_text("[mass]\nexcess_g = 1.0\n")
    message = refused(capsys, "--rig", "emps", good, "--tolerances", tmp_path / "t.toml")
    assert "mass has no 'excess_g'" in message
    assert not out.exists()


@pytest.mark.slow
def test_a_tolerance_makes_a_finding_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, recorded(replace(nominal(), mass_kg=99.0)))
    (tmp_path / "t.toml").write_text("[mass]\nexcess_kg = 5.0\n")
    code, text, _ = run(capsys, "--rig", "emps", path, "--no-closed-loop")
    assert code == 0
    assert text.startswith("EXPLAINED. Axis: the axis moves 99.0")
    code, text, _ = run(
        capsys, "--rig", "emps", path, "--no-closed-loop", "--tolerances", tmp_path / "t.toml"
    )
    assert code == 0
    assert text.startswith("CONSISTENT.")
