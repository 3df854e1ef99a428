"""Three Omnids drive payload (a) sideways by 0.5 m and yaw it by 20 deg, with compliant arms.

Every base follows its planned place under the moving payload; the arms only hold.

python scenarios/carry_sideways.py [--payload a] [--out FOLDER]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imsave

from mocobot import InputError, TeamScene, TrialLog, build_team, run_trial
from mocobot.bases import (
    BaseDrive,
    DriveLog,
    Leg,
    PlanarMotion,
    Snapshots,
    carried,
    compose,
    plan,
    relative,
    yaw_of,
)
from mocobot.pictures import Camera, Marks, make_folder, render
from mocobot.robots import forward_kinematics, omnid_design
from mocobot.trajectories import RATE_HZ, Trajectory

SIDEWAYS_M, YAW_RAD = 0.5, np.deg2rad(20.0)
BEGIN_S, SIDE_S, TURN_S, REST_S = 1.5, 4.0, 4.0, 1.0


def main() -> None:
    """Run the trial with the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--payload", default="a", help="name of a shipped payload, or a payload MJCF")
    parser.add_argument(
        "--out", type=Path, default=Path("out/carry_sideways"), help="folder for the pictures"
    )
    options = parser.parse_args()
    try:
        carry(options.payload, options.out)
    except InputError as error:
        parser.error(str(error))


def carry(payload: str, out: Path) -> None:
    """Run the trial, print the errors, and draw the motion."""
    make_folder(out)
    scene = build_team(payload, released=True)
    middle = scene.X_1i.translation[:, :2].mean(
        axis=0
    )  # reference point: it moves straight, and the payload rotates about it
    aside = (middle[0], middle[1] + SIDEWAYS_M)
    motion = plan(
        (*middle, 0.0),
        [Leg((*aside, 0.0), SIDE_S, REST_S), Leg((*aside, YAW_RAD), TURN_S, REST_S)],
        rest_s=BEGIN_S,
    )
    places = np.column_stack([scene.mounts.translation[:, :2], yaw_of(scene.mounts.rotation.as_matrix())])
    drive, snapshots = BaseDrive(carried(motion, places)), Snapshots([0.0, 6.0, motion.duration_s])
    samples = round(motion.duration_s * RATE_HZ) + 1
    hold = Trajectory("static", np.tile(scene.wrist_home_b, (samples, 1, 1)))
    log = run_trial(scene, hold, actors=[drive, snapshots])
    bases, led = drive.log(), reference(scene, log)
    report(motion, log, bases, led)

    plot(motion, log, bases, led, out / "carry_sideways.png")
    print(out / "carry_sideways.png")
    marks = Marks()
    marks.path(
        np.column_stack([led[::10, :2], np.full(len(led[::10]), 0.004)]), 0.008, (0.16, 0.44, 0.82, 1.0)
    )
    for i in range(scene.robots):
        way = bases.true[::10, i, :2]
        marks.path(np.column_stack([way, np.full(len(way), 0.004)]), 0.006, (0.88, 0.48, 0.22, 1.0))
    view = Camera((middle[0], middle[1] + 0.3, 0.35), 3.5, 200.0, -50.0)
    pictures = render(
        scene.compile(), [snapshots.qpos[0], snapshots.qpos[-1]], view, [Marks(), marks], 1000, 800
    )
    if isinstance(pictures, str):
        print(pictures)
    else:
        imsave(out / "carry_sideways_scene.png", np.hstack(pictures))
        print(out / "carry_sideways_scene.png")


def reference(scene: TeamScene, log: TrialLog) -> np.ndarray:
    """Return the true position of the payload's reference point [m] and the payload's yaw [rad], shape (Q, 3)."""
    middle = scene.X_1i.translation[:, :2].mean(axis=0)
    frame = np.column_stack([log.p_W1[:, :2], np.unwrap(yaw_of(log.R_W1))])
    return compose(frame, relative(frame[0], [*middle, 0.0]))


def report(motion: PlanarMotion, log: TrialLog, bases: DriveLog, led: np.ndarray) -> None:
    """Print the errors at the ends of both legs, and the largest errors in between."""
    planned = motion.pose[:: round(motion.rate_hz / RATE_HZ), 0]
    off, base_off, belief = led - planned, bases.true - bases.planned, bases.true - bases.odometry
    print("true - planned          payload: x, y [mm], yaw [deg]      worst base [mm], [deg]")
    for name, t in (
        ("after 0.5 m sideways", BEGIN_S + SIDE_S + REST_S),
        ("after 20 deg of yaw", motion.duration_s),
    ):
        k = round(t * RATE_HZ)
        print(
            f"{name:22s} {1e3 * off[k, 0]:8.2f} {1e3 * off[k, 1]:8.2f} {np.rad2deg(off[k, 2]):8.3f}        "
            f"{1e3 * np.linalg.norm(base_off[k, :, :2], axis=-1).max():8.2f} "
            f"{np.rad2deg(np.abs(base_off[k, :, 2]).max()):8.3f}"
        )
    wrist = forward_kinematics(log.phi, omnid_design())
    print(
        f"largest on the way     {1e3 * np.abs(off[:, 0]).max():8.2f} {1e3 * np.abs(off[:, 1]).max():8.2f} "
        f"{np.rad2deg(np.abs(off[:, 2]).max()):8.3f}        "
        f"{1e3 * np.linalg.norm(base_off[..., :2], axis=-1).max():8.2f} "
        f"{np.rad2deg(np.abs(base_off[..., 2]).max()):8.3f}"
    )
    print(
        f"odometry off by at most {1e3 * np.linalg.norm(belief[..., :2], axis=-1).max():.2f} mm, "
        f"{np.rad2deg(np.abs(belief[..., 2]).max()):.3f} deg;  slip rms {1e3 * np.sqrt(np.mean(bases.slip**2)):.2f}, "
        f"largest {1e3 * np.abs(bases.slip).max():.1f} mm/s;  load of a wheel {bases.load[50:].min():.0f} .. "
        f"{bases.load.max():.0f} N\n"
        f"wrists leave home by at most {1e3 * np.linalg.norm(wrist - wrist[0], axis=-1).max():.1f} mm;  "
        f"payload's height changes by {1e3 * np.ptp(log.p_W1[:, 2]):.2f} mm, its tilt by "
        f"{np.rad2deg(np.arccos(np.clip(log.R_W1[:, 2, 2], -1, 1)).max()):.3f} deg;  largest SEA torque "
        f"{np.abs(log.tau).max():.2f} N m\n"
        f"rods open by {1e6 * log.rod_error_m:.2f} um, welds by {1e6 * log.weld_error_m:.2f} um at most"
    )


def plot(motion: PlanarMotion, log: TrialLog, bases: DriveLog, led: np.ndarray, path: Path) -> None:
    """Plot commanded and achieved motion of payload and bases."""
    planned = motion.pose[:: round(motion.rate_hz / RATE_HZ), 0]
    figure = Figure(figsize=(12, 7.0), layout="constrained")  # without pyplot, no display is needed
    axes = figure.subplots(2, 3)
    grey, colours = "#6b7280", ("#2f6fd0", "#e07b39", "#2a9d8f")
    top = axes[0]
    top[0].plot(log.time, planned[:, 1] - planned[0, 1], color=grey, lw=4, alpha=0.4, label="commanded")
    top[0].plot(log.time, led[:, 1] - led[0, 1], color=colours[0], label="payload")
    top[0].set(title="sideways [m]")
    top[1].plot(log.time, np.rad2deg(planned[:, 2]), color=grey, lw=4, alpha=0.4, label="commanded")
    top[1].plot(log.time, np.rad2deg(led[:, 2]), color=colours[0], label="payload")
    top[1].set(title="yaw [deg]")
    off = led - planned
    for k, name in enumerate(("x", "y")):
        top[2].plot(log.time, 1e3 * off[:, k], color=colours[k], label=f"{name} [mm]")
    top[2].plot(log.time, 10.0 * np.rad2deg(off[:, 2]), color=colours[2], label="yaw [0.1 deg]")
    top[2].set(title="payload: true - commanded")
    wrist = forward_kinematics(log.phi, omnid_design())
    for i in range(log.robots):
        colour, name = colours[i % 3], f"omnid{i + 1}"
        belief = np.linalg.norm(bases.true[:, i, :2] - bases.odometry[:, i, :2], axis=1)
        axes[1, 0].plot(log.time, 1e3 * belief, color=colour, label=name)
        axes[1, 1].plot(
            log.time, 1e3 * np.linalg.norm(wrist[:, i] - wrist[0, i], axis=1), color=colour, label=name
        )
        axes[1, 2].plot(bases.time, 1e3 * bases.slip[:, i], color=colour, lw=0.7)
    axes[1, 0].set(title="bases: true - odometry [mm]", xlabel="t [s]")
    axes[1, 1].set(title="wrists, distance from home [mm]", xlabel="t [s]")
    axes[1, 2].set(title="slip along the roller's axle [mm/s]", xlabel="t [s]")
    for axis in (*top, axes[1, 0], axes[1, 1]):
        axis.legend(frameon=False, fontsize=8)
    for axis in axes.ravel():
        axis.grid(alpha=0.25)
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
