"""One motion of an arm, written at two rates, in two units of angle and torque, and in three containers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import mocobot
from estimator.filtering import low_pass
from followed_arm import RATE_HZ, arm_log, arm_model, both, rubs
from joint_logs import write_csv
from mocobot.api.calibration import JointCalibration
from mocobot.api.diagnosis import Diagnosis

NAMES = ("turn", "shoulder", "elbow")
JOINT_STATE = "sensor_msgs/msg/JointState"
START_NS = 1_700_000_000_000_000_000
UNITS = {"rad": 1.0, "deg": 180.0 / np.pi, "Nm": 1.0, "mNm": 1000.0}


def heavier(spec: mujoco.MjSpec) -> None:
    """Its last link weighs 1.5 kg more, at its own centre."""
    spec.body("three").mass += 1.5


TRUE = both(rubs(0.5, 0.3), heavier)


def as_csv(path: Path, t: np.ndarray, q: np.ndarray, torque: np.ndarray) -> Path:
    columns = {f"q {name}": q[:, j] for j, name in enumerate(NAMES)}
    columns |= {f"torque {name}": torque[:, j] for j, name in enumerate(NAMES)}
    return write_csv(path, {"t": t} | columns)


def as_parquet(path: Path, t: np.ndarray, q: np.ndarray, torque: np.ndarray) -> Path:
    columns = {f"q {name}": q[:, j] for j, name in enumerate(NAMES)}
    columns |= {f"torque {name}": torque[:, j] for j, name in enumerate(NAMES)}
    pq.write_table(pa.table({"t": t} | columns), path)
    return path


def as_bag(path: Path, t: np.ndarray, q: np.ndarray, torque: np.ndarray) -> Path:
    store = get_typestore(Stores.ROS2_HUMBLE)
    head, stamp, state = (
        store.types[name] for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", JOINT_STATE)
    )
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topic = bag.add_connection("/joint_states", JOINT_STATE, typestore=store)
        for k, at in enumerate(START_NS + np.rint(1e9 * t).astype(np.int64)):
            sec, nanosec = divmod(int(at), 1_000_000_000)
            order = [2, 0, 1]  # a driver has its own order
            message = state(
                header=head(stamp=stamp(sec=sec, nanosec=nanosec), frame_id=""),
                name=[NAMES[j] for j in order], position=q[k, order], velocity=np.zeros(0), effort=torque[k, order],
            )  # fmt: skip
            bag.write(topic, int(at) + 300_000, store.serialize_cdr(message, JOINT_STATE))
    return path


@dataclass(frozen=True)
class Form:
    """How a motion is written: container, every how many samples, and the units of angle and torque."""

    name: str
    every: int
    angle: str
    effort: str

    def write(self, folder: Path, t: np.ndarray, q: np.ndarray, torque: np.ndarray) -> tuple[Path, Path]:
        """Write the log and its map; a lower rate comes after a low-pass at four tenths of it."""
        if self.every > 1:
            cutoff = 0.4 * RATE_HZ / self.every
            q, torque = (low_pass(x, RATE_HZ, cutoff) for x in (q, torque))
        rows = slice(None, None, self.every)
        write = {"csv": as_csv, "parquet": as_parquet, "bag": as_bag}[self.name]
        path = folder / ("bag" if self.name == "bag" else f"log.{self.name}")
        log = write(path, t[rows], UNITS[self.angle] * q[rows], UNITS[self.effort] * torque[rows])
        place = {"q": 'column = "q {joint}"', "torque": 'column = "torque {joint}"'}
        if self.name == "bag":
            state = 'topic = "/joint_states", joint = "{joint}", field = '
            place = {"q": f'{state}"position"', "torque": f'{state}"effort"'}
        lines = ["version = 1", 'joints = ["turn", "shoulder", "elbow"]']
        lines += [] if self.name == "bag" else ['time = { column = "t", unit = "s" }']
        lines += ["[channels]", f'q = {{ {place["q"]}, unit = "{self.angle}" }}']
        lines += [f'torque = {{ {place["torque"]}, unit = "{self.effort}" }}']
        (folder / "map.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return log, folder / "map.toml"


PLAIN = Form("csv", 1, "rad", "Nm")
OTHERS = (Form("parquet", 2, "deg", "mNm"), Form("bag", 2, "rad", "Nm"), Form("bag", 1, "deg", "mNm"))
Read = tuple[Diagnosis, JointCalibration]


def read(folder: Path, form: Form) -> Read:
    motion = arm_log(TRUE, 5)
    assert motion.torque is not None
    model = arm_model(folder)
    log, log_map = form.write(folder, motion.time, motion.q, motion.torque)
    verdict = mocobot.diagnose(log, model, map=log_map, closed_loop=False)
    return verdict, mocobot.calibrate(log, model, map=log_map)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Read:
    return read(tmp_path_factory.mktemp("plain"), PLAIN)


def named(verdict: Diagnosis) -> set[str]:
    return {cause["name"] for cause in verdict.to_dict()["causes"]}


def test_the_plain_form_tells_what_is_wrong(plain: Read) -> None:
    """Friction in all joints and a heavier last link."""
    causes = {(cause["cause"], cause["place"]) for cause in plain[0].to_dict()["causes"]}
    assert causes == {("friction", "all joints"), ("link_mass", "link three")}


@pytest.mark.parametrize("form", OTHERS, ids=lambda form: f"{form.name} {form.every} {form.angle}")
def test_rate_units_and_container_do_not_matter(tmp_path: Path, plain: Read, form: Form) -> None:
    verdict, calibration = read(tmp_path, form)
    assert verdict.to_dict()["verdict"] == plain[0].to_dict()["verdict"]
    assert named(verdict) == named(plain[0])
    pairs = list(zip(calibration.found.parameters, plain[1].found.parameters, strict=True))
    off = {
        f"{one.place} {one.name}": (one.value, other.value, one.se, other.se)
        for one, other in pairs
        if abs(one.value - other.value) > 3.0 * min(one.se, other.se)
    }
    assert not off
    assert sum(one.determined and other.determined for one, other in pairs) > 10
