"""Outcomes of an interrupted run: every bit comes back, and a file of somebody else's is only refused."""

from __future__ import annotations

import io
import pickle
import zipfile
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimator.arm.unit import COUNT, ArmUnit
from estimator.calibrate.calibration import CalibratedTrial, Calibration, Prior
from estimator.errors import InputError
from estimator.estimate.leftover import Leftover
from estimator.estimate.result import PayloadEstimate, RecordingEstimate
from estimator.estimate.statics import MassEstimate
from estimator.estimate.uncertainty import StepReport, WeakDirection
from estimator.rigid_team import Bases
from mocobot_sim.paper.experiment import TrialSummary
from mocobot_sim.paper.store import Store
from recordings import metadata, small_recording


def same(a: Any, b: Any) -> bool:
    """Whether two outcomes are alike, bit by bit."""
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes("A") == b.tobytes("A")
    if is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, tuple | list):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and (a == b or (a != a and b != b))


def outcomes() -> list[Any]:
    rng = np.random.default_rng(1)
    recording = small_recording(rows=600)
    units = ArmUnit(metadata().design, rng.standard_normal((3, COUNT)))
    bases = Bases(np.asfortranarray(rng.standard_normal((3, 3))), rng.standard_normal((3, 3)))
    trial = CalibratedTrial(
        "b", "static", 0, 1.5, (3, 4), None, (0.1, np.inf), (np.nan, 1e-300), bases, {"tilt": 0.1}
    )
    calibration = Calibration(
        units, rng.standard_normal((9, 9)), rng.standard_normal((3, COUNT)), 0.0, Prior(), (), (trial,), ("a",), 4, (),
        ("x",),
    )  # fmt: skip
    weak = WeakDirection("mass", "m", (0.1, 0.2), "why")
    estimate = PayloadEstimate(
        None, 3, "staged", None, MassEstimate(np.float64(0.1) * 3, 0.2, 0.3), rng.standard_normal(3), None, None,
        (StepReport("mass", ("m",), "kg", (1.0, 0.0), 0.1, (weak,)),),
        (RecordingEstimate("a", "static", 1.0, 2, leftovers=(Leftover("force", "N", 0.1, 0.2),)),), ("flag",),
    )  # fmt: skip
    return [
        1.5, None, (rng.standard_normal((2, 3)), np.zeros((2, 3, 3), order="F")),
        ({"ideal": recording}, TrialSummary("a", 0.1, 0.2, 1e-17, 0.3, -0.0, None)), calibration,
        (estimate, None),
    ]  # fmt: skip


def test_every_bit_comes_back(tmp_path: Path) -> None:
    store = Store(tmp_path, "key", force=False)
    for k, outcome in enumerate(outcomes()):
        store.put("some stage", k, outcome)
        assert store.has("some stage", k)
        assert same(Store(tmp_path, "key", force=False).get("some stage", k), outcome), outcome


class Evil:
    """Unpickling it makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return (Path.touch, (self.path,))


def spoiled(folder: Path) -> dict[str, bytes]:
    evil, inside = pickle.dumps(Evil(folder / "executed")), io.BytesIO()
    np.savez(inside, facts=np.array([Evil(folder / "executed")], dtype=object))
    other, packed = io.BytesIO(), io.BytesIO()
    np.savez(other, facts=np.frombuffer(b'{"Popen": {"args": "true"}}', np.uint8))
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("facts.npy", bytes(1000))
    return {
        "a pickle": evil, "a pickle in an array": inside.getvalue(), "another class": other.getvalue(),
        "an unlimited packing": packed.getvalue(), "nothing": b"",
    }  # fmt: skip


@pytest.mark.parametrize(
    "what", ["a pickle", "a pickle in an array", "another class", "an unlimited packing", "nothing"]
)
def test_a_file_of_somebody_else_is_refused(tmp_path: Path, what: str) -> None:
    store = Store(tmp_path / "out", "key", force=False)
    store.put("stage", 0, 1.5)
    (file,) = store.folder.iterdir()
    file.write_bytes(spoiled(tmp_path)[what])
    with pytest.raises(InputError) as caught:
        store.get("stage", 0)
    assert str(caught.value).startswith(f"{file}: ")
    assert ("is not packed as numpy does it" in str(caught.value)) == (what == "an unlimited packing")
    assert not (tmp_path / "executed").exists()
