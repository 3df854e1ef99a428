"""One Omnid drives a square and turns in place on its mecanum wheels: what was commanded, what it did, what slipped.

python scenarios/drive_square.py [--out FOLDER]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imsave

from estimator.errors import InputError
from mocobot_sim.base.design import WHEELS, base_design
from mocobot_sim.base.drive import BaseDrive, DriveLog
from mocobot_sim.base.mecanum import MecanumKinematics
from mocobot_sim.base.motion import Leg, PlanarMotion, plan
from mocobot_sim.base.pictures import Camera, Marks, make_folder, render
from mocobot_sim.base.snapshots import Snapshots
from mocobot_sim.base.solo import build_solo, compile_solo, drive_solo

SIDE_M = 0.8
SIDES = ("forward", "left", "backward", "right")


def square(side_s: float, turn_s: float) -> PlanarMotion:
    """Four sides without turning, then one turn in place."""
    corners = [(SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M), (0.0, 0.0)]
    legs = [Leg((x, y, 0.0), side_s, rest_s=0.5) for x, y in corners]
    return plan((0.0, 0.0, 0.0), [*legs, Leg((0.0, 0.0, 2.0 * np.pi), turn_s, rest_s=0.5)], rest_s=0.5)


def main() -> None:
    """Drive with the textbook's kinematics, with those of twelve rollers, and in too much of a hurry."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/drive_square"), help="folder for the pictures")
    out = parser.parse_args().out
    try:
        make_folder(out)
    except InputError as error:
        parser.error(str(error))
    design, model = base_design(), compile_solo(build_solo())
    calm, hasty = square(4.0, 8.0), square(0.9, 4.0)
    stops = np.array([0.5, *np.cumsum([4.5] * 4 + [8.5]) + 0.5])

    snapshots = Snapshots([21.0])
    runs = {
        "textbook kinematics": (MecanumKinematics.textbook(design), calm, None),
        "kinematics with rollers": (MecanumKinematics.with_rollers(design), calm, snapshots),
        "the same, 0.9 s a side": (MecanumKinematics.with_rollers(design), hasty, None),
    }
    logs = {}
    for name, (kinematics, motion, watch) in runs.items():
        log = drive_solo(model, BaseDrive(motion, kinematics), motion.duration_s, snapshots=watch)
        logs[name] = log
        ends = stops if motion is calm else np.array([0.5, *np.cumsum([1.4] * 4 + [4.5]) + 0.5])
        print(f"{name}\n{table(log, ends)}\n")

    plot(logs["textbook kinematics"], logs["kinematics with rollers"], out / "drive_square.png")
    print(out / "drive_square.png")
    log = logs["kinematics with rollers"]
    marks, way = Marks(), log.true[::10, 0, :2]
    marks.path(np.column_stack([way, np.full(len(way), 0.004)]), 0.006, (0.16, 0.44, 0.82, 1.0))
    views = (
        Camera((0.36, 0.30, 0.26), 2.3, 215.0, -32.0),
        Camera((*(log.true[2100, 0, :2] + [-0.12, -0.14]), 0.12), 0.75, 40.0, -14.0),
    )
    pictures = [render(model, snapshots.qpos, view, [marks], 1000, 800) for view in views]
    if isinstance(pictures[0], str) or isinstance(pictures[1], str):
        print(next(words for words in pictures if isinstance(words, str)))
    else:
        imsave(out / "drive_square_scene.png", np.hstack([pictures[0][0], pictures[1][0]]))
        print(out / "drive_square_scene.png")


def table(log: DriveLog, ends: np.ndarray) -> str:
    """Where each leg should have ended, did end, and would have by odometry."""
    lines = [
        "leg          true - planned             odometry - true            slip rms   largest  least load"
    ]
    for k, name in enumerate((*SIDES, "turn 360 deg")):
        i, j = round(100 * ends[k]), round(100 * ends[k + 1])
        off, belief = log.true[j, 0] - log.planned[j, 0], log.odometry[j, 0] - log.true[j, 0]
        slip = 1e3 * log.slip[i:j]
        lines.append(
            f"{name:12s} {_pose(off)}  {_pose(belief)}"
            f" {np.sqrt(np.mean(slip**2)):7.2f} {np.abs(slip).max():9.1f} mm/s {log.load[i:j].min():7.1f} N"
        )
    return "\n".join(lines)


def _pose(error: np.ndarray) -> str:
    return f"{1e3 * error[0]:6.1f} {1e3 * error[1]:6.1f} mm {np.rad2deg(error[2]):6.2f} deg"


def plot(textbook: DriveLog, rollers: DriveLog, path: Path) -> None:
    """Paths, what the wheels did, and how far each kinematics is off."""
    figure = Figure(figsize=(12, 7.5), layout="constrained")  # without pyplot: no display, no global state
    axes = figure.subplot_mosaic([["path", "x", "yaw"], ["speed", "slip", "load"]])
    grey, blue, orange = "#6b7280", "#2f6fd0", "#e07b39"
    axis = axes["path"]
    axis.plot(*rollers.planned[:, 0, :2].T, color=grey, lw=4, alpha=0.4, label="planned")
    axis.plot(*rollers.true[:, 0, :2].T, color=blue, label="driven, with rollers")
    axis.plot(*textbook.true[:, 0, :2].T, color=orange, ls="--", label="driven, textbook")
    axis.set(title="path [m]", aspect="equal")
    axis.legend(frameon=False, fontsize=8, loc="center")
    for log, colour, name in ((textbook, orange, "textbook"), (rollers, blue, "with rollers")):
        off = log.true[:, 0] - log.odometry[:, 0]
        axes["x"].plot(log.time, 1e3 * off[:, 0], color=colour, ls=":", label=f"x, {name}")
        axes["x"].plot(log.time, 1e3 * off[:, 1], color=colour, label=f"y, {name}")
        axes["yaw"].plot(log.time, np.rad2deg(off[:, 2]), color=colour, label=name)
    axes["x"].set(title="true - odometry [mm]", xlabel="t [s]")
    axes["yaw"].set(title="true - odometry, yaw [deg]", xlabel="t [s]")
    for k, (wheel, colour) in enumerate(zip(WHEELS, (blue, orange, "#2a9d8f", "#8b5cf6"), strict=True)):
        name = wheel.replace("_", " ")
        axes["speed"].plot(rollers.time, rollers.speed[:, 0, k], color=colour, label=name)
        axes["speed"].plot(rollers.time, rollers.commanded_speed[:, 0, k], color="black", lw=0.6, ls=":")
        axes["slip"].plot(rollers.time, 1e3 * rollers.slip[:, 0, k], color=colour, lw=0.8, label=name)
        axes["load"].plot(rollers.time, rollers.load[:, 0, k], color=colour, lw=0.8, label=name)
    axes["speed"].set(title="wheel speeds, commanded dotted [rad/s]", xlabel="t [s]")
    axes["slip"].set(title="slip along the roller's axle [mm/s]", xlabel="t [s]")
    axes["load"].set(title="load of the wheels [N]", xlabel="t [s]", ylim=(0, None))
    for name in ("x", "yaw", "speed"):
        axes[name].legend(frameon=False, fontsize=8)
    for axis in axes.values():
        axis.grid(alpha=0.25)
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
