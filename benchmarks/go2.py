"""A real quadruped that hangs and tells no torque: both front legs calibrated from commands, positions and gains.

    python benchmarks/go2.py FOLDER

FOLDER holds ``front_legs.csv`` and ``go2.xml``, made from the public dataset of iit-DLSLab's
sim2real-robot-identification (``datasets/go2/traj_0.pt``, BSD 3-Clause): six joints at 200 Hz under the same chirp,
drives with 20 N m/rad and 1.5 N m s/rad. Positions are fitted in the closed loop. Left and right legs are mirror
images, so their rotors, friction and delays must agree within standard errors. Forecasts know the commands alone for
one second; each third of the log is forecast with values from the others.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
import tyro

import mocobot

JOINTS = ("hip", "thigh", "calf")
REAR = {"hip": 0.0, "thigh": 1.2, "calf": -2.4}
MAP = """version = 1
joints = [JOINTS]
time = { column = "time_s", unit = "s" }
[channels]
q = { column = "{joint}_position_rad", unit = "rad" }
command = { column = "{joint}_command_rad", unit = "rad" }
[control]
command = "position"
gain_of = "torque"
position_gain = 20
velocity_gain = 1.5
limit = [23.7, 23.7, 45.43, 23.7, 23.7, 45.43]
"""


def main(folder: tyro.conf.Positional[Path]) -> None:
    """Print both legs' values beside each other, errors of forecasts, and the calibration's notes."""
    logged = [f"{side}_{joint}_joint" for side in ("FL", "FR") for joint in JOINTS]
    lock = [f"{leg}_{joint}_joint={x}" for leg in ("RL", "RR") for joint, x in REAR.items()]
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "log.toml"
        path.write_text(MAP.replace("JOINTS", ", ".join(f'"{n}"' for n in logged)), encoding="utf-8")
        begun = time.process_time()
        calibration = mocobot.calibrate(
            folder / "front_legs.csv", folder / "go2.xml", map=path, lock=lock, same=("FL=FR",)
        )
    found = calibration.found
    print(f"{time.process_time() - begun:.1f} s of CPU\n")
    print("\n".join([*found.same[0].lines(), ""]))
    for title, which in (
        ("motion", "torque"),
        ("given model", "model"),
        ("calibrated", "calibrated"),
        ("noise", "noise"),
    ):
        sizes = np.sqrt(np.mean([np.square(getattr(h, which)) for h in found.held_out], axis=0))
        print(f"{title:<16}[mrad] " + "".join(f"{1e3 * x:>9.3g}" for x in sizes))
    print("\n" + "\n".join(found.notes))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
