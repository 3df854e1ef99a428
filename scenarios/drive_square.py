"""One Omnid drives a square and turns in place on mecanum wheels: compare commanded and actual motion and wheel slip.

python scenarios/drive_square.py [--pace SECONDS] [--out FOLDER]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imsave

import mocobot
from mocobot.bases import (
    WHEELS,
    BaseDrive,
    DriveLog,
    Leg,
    MecanumKinematics,
    PlanarMotion,
    Snapshots,
    base_design,
    build_solo,
    compile_solo,
    drive_solo,
    plan,
)
from mocobot.pictures import Camera, Marks, make_folder, render
from mocobot.trajectories import RATE_HZ

SIDE_M = 0.8
HURRY_S = 0.9  # per side: requires 5.7 m/s^2, but the rollers slip above 4.9
SIDES = ("forward", "left", "backward", "right")


def square(side_s: float) -> tuple[PlanarMotion, np.ndarray]:
    """Plan four sides without rotation and a turn in place that takes twice as long.

    Returns:
        The motion, and the times at which the legs begin and end [s], shape (6,).
    """
    corners = [(SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M), (0.0, 0.0)]
    legs = [Leg((x, y, 0.0), side_s, rest_s=0.5) for x, y in corners]
    legs.append(Leg((0.0, 0.0, 2.0 * np.pi), 2.0 * side_s, rest_s=0.5))
    ends = 0.5 + np.cumsum([0.0, *(leg.duration_s + leg.rest_s for leg in legs)])
    return plan((0.0, 0.0, 0.0), legs, rest_s=0.5), ends


def main() -> None:
    """Compare textbook kinematics, kinematics with rollers, and a motion that is too fast."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/drive_square"), help="folder for the pictures")
    parser.add_argument(
        "--pace", type=float, default=4.0, help="seconds per side of 0.8 m; a full turn takes two"
    )
    options = parser.parse_args()
    try:
        compare(options.pace, options.out)
    except mocobot.InputError as error:
        parser.error(str(error))


def compare(pace_s: float, out: Path) -> None:
    """Drive three times, print the errors, and draw the motion."""
    calm, hasty = square(pace_s), square(HURRY_S)
    make_folder(out)
    design, model = base_design(), compile_solo(build_solo())
    turning = 0.5 * (calm[1][4] + calm[1][5]) - 0.25  # middle of the turn
    snapshots = Snapshots([turning])
    runs = {
        "textbook kinematics": (MecanumKinematics.textbook(design), calm, None),
        "kinematics with rollers": (MecanumKinematics.with_rollers(design), calm, snapshots),
        f"the same, {HURRY_S:g} s a side": (MecanumKinematics.with_rollers(design), hasty, None),
    }
    logs = []
    for name, (kinematics, (motion, ends), watch) in runs.items():
        logs.append(drive_solo(model, BaseDrive(motion, kinematics), motion.duration_s, snapshots=watch))
        print(f"{name}\n{table(logs[-1], ends)}\n")

    plot(logs[0], logs[1], out / "drive_square.png")
    print(out / "drive_square.png")
    marks, way = Marks(), logs[1].true[::10, 0, :2]
    marks.path(np.column_stack([way, np.full(len(way), 0.004)]), 0.006, (0.16, 0.44, 0.82, 1.0))
    wheel = logs[1].true[round(turning * RATE_HZ), 0, :2] + [-0.12, -0.14]
    pictures = [
        render(model, snapshots.qpos, view, [marks], 1000, 800)
        for view in (Camera((0.36, 0.30, 0.26), 2.3, 215.0, -32.0), Camera((*wheel, 0.12), 0.75, 40.0, -14.0))
    ]
    made = [picture[0] for picture in pictures if not isinstance(picture, str)]
    if len(made) == len(pictures):
        imsave(out / "drive_square_scene.png", np.hstack(made))
        print(out / "drive_square_scene.png")
    else:
        print(next(words for words in pictures if isinstance(words, str)))


def table(log: DriveLog, ends: np.ndarray) -> str:
    """Tabulate, for each leg, the errors of its end point and of odometry, the slip and the wheel load."""
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
    """Plot paths, wheel speeds, slip and load, and the odometry error of both kinematics."""
    figure = Figure(figsize=(12, 7.5), layout="constrained")  # without pyplot, no display is needed
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
