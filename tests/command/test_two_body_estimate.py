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
