"""Two bodies from the command line and from Python."""

import json
import re

import numpy as np
import pytest

import mocobot
from command import refused, run
from estimator.recording.parquet import write_recording
from synthetic_team import with_noise
from two_body_team import TwoBodies, carried


@pytest.fixture(scope="module")
def door(tmp_path_factory: pytest.TempPathFactory):
    """A recording of a hinged payload, with the truth beside it."""
    rng, bodies = np.random.default_rng(8), TwoBodies()
    path = tmp_path_factory.mktemp("two") / "door.parquet"
    write_recording(with_noise(carried(bodies, rng, 20.0, joint_rms=0.06), 6e-6, 0.01, rng), path)
    path.with_suffix(".truth.json").write_text(json.dumps(bodies.truth))
    return path


def test_auto_tries_two_bodies_where_one_is_refused(door, capsys, tmp_path):
    code, out, err = run(capsys, "estimate", door, "--out", tmp_path / "door.json")
    assert (code, err) == (0, "")
    assert out.startswith(
        "[[Payload: two bodies, hinged]]  robots 1 | 2 3, 1 recording\n    Not one rigid body: "
    )
    mass = re.search(r"    m: +(\d+\.\d+) \+- (0\.000\d+) kg  \(true 10\.50+\)", out)
    assert mass is not None
    assert float(mass[1]) == pytest.approx(10.5, abs=5.0 * float(mass[2]))
    assert len(out.splitlines()) <= 30
    found = mocobot.read_estimate(tmp_path / "door.json")
    assert isinstance(found, mocobot.TwoBodyEstimate)
    assert found.kind == "hinged"
    assert "hinged, 10.5 kg" in repr(found)
    found.write(tmp_path / "again.json")
    first, again = (json.loads((tmp_path / name).read_text()) for name in ("door.json", "again.json"))
    assert again["parameters"] == first["parameters"]


def test_rigid_refuses_as_before(door, capsys):
    message = refused(capsys, "estimate", door, "--payload", "rigid")
    assert "do not move like one rigid body" in message
    assert "two bodies" not in message


def test_a_slide_does_not_explain_a_hinge(door):
    with pytest.raises(mocobot.InputError, match="no slide explains"):
        mocobot.estimate(door, payload="sliding")


@pytest.mark.parametrize("fields", [{"self_calibrate": True}, {"method": "staged"}])
def test_options_of_a_rigid_payload_are_refused(door, fields):
    with pytest.raises(mocobot.InputError, match="is of a rigid payload, and payload is 'hinged'"):
        mocobot.estimate(door, payload="hinged", **fields)


@pytest.fixture(scope="module")
def estimates(tmp_path_factory: pytest.TempPathFactory):
    """Estimates of three recordings: twice the same sprung payload, then one whose spring is softer."""
    folder, paths = tmp_path_factory.mktemp("estimates"), []
    for k, stiffness in enumerate((70.0, 70.0, 66.0)):
        rng, bodies = np.random.default_rng([20, k]), TwoBodies(stiffness=stiffness, rest=0.02)
        one = with_noise(carried(bodies, rng, 20.0, joint_rms=0.06), 6e-6, 0.01, rng)
        paths.append(folder / f"{k}.json")
        mocobot.estimate(one, payload="flexible").write(paths[-1])
    return paths


def test_estimates_of_one_payload_agree(estimates, capsys, tmp_path):
    code, out, err = run(capsys, "compare", *estimates[:2], "--json", tmp_path / "same.json")
    assert (code, err) == (0, "")
    assert "NOTHING CHANGED" in out
    values = json.loads((tmp_path / "same.json").read_text())
    assert values["kind"] == "estimate of two bodies"
    names = {group["name"] for group in values["groups"]}
    assert names >= {"axis from A's", "pivot from A's", "mass", "stiffness", "offset"}
    # The zeros of both joints differ, and the offset counts from A's.
    assert all(group["p"] > 1e-3 for group in values["groups"])


def test_a_softer_spring_is_told(estimates, capsys):
    code, out, _ = run(capsys, "compare", estimates[0], estimates[2], "--strict")
    assert code == 1
    assert re.search(r"CHANGED beyond its errors.*stiffness \(by -[34]\.", " ".join(out.split()))


def test_another_joint_has_no_common_numbers(estimates, tmp_path):
    values = json.loads(estimates[0].read_text()) | {"halves": [[1, 2], [3]]}
    (tmp_path / "other.json").write_text(json.dumps(values))
    found = mocobot.compare(estimates[0], tmp_path / "other.json")
    assert found.changed
    assert not found.groups
    assert "robots 1 | 2 3 in A, and hinged between robots 1 2 | 3 in B" in found.changes[0]


def test_the_report_shows_joint_bodies_and_truth(door, capsys, tmp_path):
    folder = tmp_path / "results"
    folder.mkdir()
    assert run(capsys, "estimate", door, "--payload", "hinged", "--out", folder / "door.json")[0] == 0
    code, _, err = run(capsys, "report", folder)
    assert (code, err) == (0, "")
    page = (folder / "report.html").read_text()
    found = mocobot.read_estimate(folder / "door.json")
    text = re.sub(r"<[^>]*>", "", page)
    assert "Payload of two bodies, estimated from 1 recording" in text
    assert "Robots 1 | 2 3 hold" in text
    assert f"({', '.join(f'{x:.4g}' for x in found.axes[:, 0])})".replace("-", "\u2212") in text
    assert re.search(r"mass\s*kg\s*10\.\d+\s*± 0\.000\d+\s*10\.500\s", text)
    assert page.count('class="plot"') == 1


def test_a_broken_estimate_is_refused(estimates, capsys, tmp_path):
    values = json.loads(estimates[0].read_text())
    del values["joint"]["covariance"]
    (tmp_path / "door.json").write_text(json.dumps(values))
    assert "door.json: not a complete estimate of two bodies" in refused(capsys, "report", tmp_path)
    assert "not a complete estimate of two bodies" in refused(
        capsys, "compare", tmp_path / "door.json", estimates[0]
    )
