"""Reading of bags against the libraries alone: python benchmarks/speed/bag.py [MINUTES]

Two bags are written in both storages: a trial of 110 s of three robots at 100 Hz with commands, and one minute (or
MINUTES) of ten robots at 1 kHz without. Every reading happens in a process of its own:

- mocobot: ``open_bag`` and all its chunks, which are arrays in SI then;
- rosbags: ``Reader.messages`` and ``deserialize_cdr`` of every message, which are objects then;
- mcap-ros2-support: ``iter_decoded_messages`` (MCAP only), objects as well;
- bytes: the file from front to back, nothing more.
"""

from __future__ import annotations

import multiprocessing
import re
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from mocobot_logs.bag.read import open_bag
from mocobot_logs.bag.write import write_bag
from mocobot_sim.scene.models import omnid_design

SUFFIX = {"mcap": ".mcap", "sqlite3": ".db3"}


def sway(seconds: float, robots: int, rate_hz: float, *, ref: bool) -> Recording:
    """Slow sines with the noise and steps of real sensors: 16-bit angles, torques in steps of 0.01 N m."""
    rng = np.random.default_rng(0)
    time_s = np.arange(round(seconds * rate_hz)) / rate_hz
    hertz = rng.uniform(0.3, 0.9, (robots, 12))
    wave = np.sin(2 * np.pi * time_s[:, None, None] * hertz).reshape(len(time_s), robots, 4, 3)
    step = 2 * np.pi / 2**16
    angle = np.round((0.5 + 0.1 * wave[:, :, :2]) / step) * step
    tau = (
        np.round((2.0 + 0.5 * wave[:, :, 2] + 0.01 * rng.standard_normal(wave[:, :, 2].shape)) / 0.01) * 0.01
    )
    metadata = RecordingMetadata(robots, rate_hz, "random", "bag_speed", None, 0, omnid_design())
    theta = angle[:, :, 1] - 0.5
    return Recording(time_s, angle[:, :, 0], theta, tau, 0.02 * wave[:, :, 3] if ref else None, metadata)


def with_mocobot(path: Path) -> int:
    """Samples read."""
    return sum(len(samples.stamp_ns) for _, samples in open_bag(path).chunks(lambda _: None))


def with_rosbags(path: Path) -> int:
    """Messages read."""
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    types, count = get_typestore(Stores.LATEST), 0
    with Reader(path) as reader:
        for connection, _, data in reader.messages():
            types.deserialize_cdr(data, connection.msgtype)
            count += 1
    return count


def with_mcap_ros2(path: Path) -> int:
    """Messages read."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages())


def as_bytes(path: Path) -> int:
    """Bytes read."""
    with path.open("rb") as file:
        return sum(len(part) for part in iter(lambda: file.read(1 << 20), b""))


def measured(read: Callable[[Path], int], path: Path) -> tuple[float, float, float]:
    """Wall time [s], CPU time [s] and peak memory [MB] of one reading, imports and one small bag before it."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        return pool.apply(_measure, (read, path))


def _measure(read: Callable[[Path], int], path: Path) -> tuple[float, float, float]:
    with tempfile.TemporaryDirectory() as folder:  # imports and generated code are no part of the speed
        small = Path(folder) / f"small{path.suffix}"
        recording = sway(1.0, 1, 100.0, ref=True)
        write_bag(recording, small, storage="mcap" if path.suffix == ".mcap" else "sqlite3")
        read(small)
    wall, cpu = time.perf_counter(), time.process_time()
    read(path)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    # Not ru_maxrss, which a process inherits from the one that starts it.
    status = Path("/proc/self/status").read_text()
    return wall, cpu, float(re.search(r"VmHWM:\s+(\d+)", status)[1]) / 1024  # type: ignore[index]


def main() -> None:
    """Print sizes, times, ratios and peak memory."""
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 1.0
    cases = (
        ("110 s, 3 robots, 100 Hz, with commands", sway(110.0, 3, 100.0, ref=True)),
        (f"{60 * minutes:g} s, 10 robots, 1 kHz", sway(60.0 * minutes, 10, 1000.0, ref=False)),
    )
    readers = (("mocobot", with_mocobot), ("rosbags", with_rosbags), ("mcap-ros2-support", with_mcap_ros2))
    with tempfile.TemporaryDirectory() as folder:
        for what, recording in cases:
            parquet = Path(folder) / "recording.parquet"
            write_recording(replace(recording, metadata=replace(recording.metadata, rate_hz=100.0)), parquet)
            messages = len(recording.time) * recording.metadata.robots * (1 if recording.ref is None else 2)
            print(f"{what}: {messages} messages; Parquet {parquet.stat().st_size / 1e6:.1f} MB")
            for storage, suffix in SUFFIX.items():
                path = Path(folder) / f"bag{suffix}"
                start = time.process_time()
                write_bag(recording, path, storage=storage)  # type: ignore[arg-type]
                spent = time.process_time() - start
                size = path.stat().st_size
                print(
                    f"  {suffix}: {size / 1e6:.1f} MB, {size / messages:.0f} bytes per message, "
                    f"written in {spent:.1f} s ({1e6 * spent / messages:.1f} us per message)"
                )
                ours = 0.0
                for name, read in (*readers, ("bytes", as_bytes)):
                    if name == "mcap-ros2-support" and storage != "mcap":
                        continue
                    wall, cpu, peak = measured(read, path)
                    ours = ours or cpu
                    print(
                        f"    {name:18} {wall:7.2f} s, CPU {cpu:7.2f} s, {1e6 * cpu / messages:6.2f} us per message, "
                        f"{cpu / ours:6.2f} x mocobot, peak {peak:5.0f} MB",
                        flush=True,
                    )
                path.unlink()


if __name__ == "__main__":
    main()
