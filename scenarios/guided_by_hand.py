"""A person guides the payload that three Omnids carry: compare the required forces with and without an estimate.

The arms have no stiffness and only compensate the payload's weight. The person's hands move a handle over the middle
of the frame along the same path in every case. Then the bases are released and follow the person across the room.

python scenarios/guided_by_hand.py [--payload a] [--estimate est.json] [--out FOLDER]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imsave

import mocobot
from mocobot import Estimate, GroundTruth, InputError, TeamScene, build_team, run_trial
from mocobot.bases import DriveLog, FollowingDrive, Snapshots
from mocobot.guiding import FLOAT_GAINS, FloatArms, Grip, GuidingHand, HandLog, Move, Payload
from mocobot.pictures import Camera, Marks, make_folder, render
from mocobot.robots import ControlGains, draw_units
from mocobot.trajectories import RATE_HZ, Trajectory

BEGIN_S = 3.0
# Aside, up and tilted, then hold, and back.
PATH = (
    Move((0.06, 0.0, 0.04), (float(np.deg2rad(6.0)), 0.0, 0.0), 2.0, 1.5),
    Move((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 2.0, 1.5),
)
ACROSS_THE_ROOM = (Move((0.0, 0.6, 0.03), (0.0, 0.0, float(np.deg2rad(20.0))), 6.0, 2.0),)
HANDS = Grip()
# A stiff grip keeps the motion equal within millimetres in all cases, so that the forces can be compared.
FIRM = Grip(20000.0, 1500.0, 2000.0, 100.0)
GUESS_KG = 10.0


@dataclass(frozen=True)
class Case:
    """One way of carrying.

    Attributes:
        name: behaviour of the robots.
        arms: controller of floating arms; None for arms that hold their initial position.
        gains: control gains of the arms.
        scene: scene of the team.
    """

    name: str
    arms: FloatArms | None
    gains: ControlGains
    scene: TeamScene


def main() -> None:
    """Run the comparison with the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--payload", default="a", help="name of a shipped payload, or a payload MJCF")
    parser.add_argument(
        "--estimate", type=Path, help="what `mocobot estimate` wrote; without it, it is made here"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out/guided_by_hand"), help="folder for the pictures"
    )
    options = parser.parse_args()
    try:
        compare(options.payload, options.estimate, options.out)
    except InputError as error:
        parser.error(str(error))


def compare(payload: str, estimate_path: Path | None, out: Path) -> None:
    """Estimate the payload unless an estimate is given, run all cases, and print and draw the results."""
    make_folder(out)
    team = build_team(payload)
    if team.robots < 3:
        raise InputError(f"{payload}: has {team.robots} grasps; floating needs three robots or more")
    truth = Payload.of_truth(GroundTruth.of(team))
    cases = [
        Case("stiff arms that hold their place", None, ControlGains(), team),
        Case("arms carry only themselves", FloatArms(replace(truth, mass_kg=0.0)), FLOAT_GAINS, team),
        Case(f"guess: {GUESS_KG:g} kg, amid the grasps", FloatArms(_guess(truth)), FLOAT_GAINS, team),
        Case("forces measured at the start", FloatArms(None), FLOAT_GAINS, team),
    ]
    if estimate_path is not None:
        known = read_estimate(estimate_path)
        if len(known.p_1i) != team.robots:
            raise InputError(
                f"{estimate_path}: is for {len(known.p_1i)} grasps; the payload has {team.robots}"
            )
        cases.append(Case("estimate from the file", FloatArms(known), FLOAT_GAINS, team))
    else:
        for preset in ("nominal", "uncalibrated"):
            units = draw_units(payload, mocobot.PRESETS[preset], seed=0)
            estimate = make_estimate(payload, preset)
            print(_score(preset, estimate, truth))
            scene = build_team(payload, units)
            if units:
                cases.append(Case(f"forces measured, {preset} robots", FloatArms(None), FLOAT_GAINS, scene))
            arms = FloatArms(Payload.of_estimate(estimate), units)
            cases.append(Case(f"estimate, {preset} robots", arms, FLOAT_GAINS, scene))
    grip_1 = _handle(truth)
    logs = [[guide(case, grip_1, grip) for grip in (FIRM, HANDS)] for case in cases]
    print(table(cases, logs, truth))

    following, bases, pictures = across_the_room(payload, cases[-1], grip_1)
    print(journey(cases[-1].name, following, bases))
    plot(cases, [firm for firm, _ in logs], following, bases, out / "guided_by_hand.png")
    print(out / "guided_by_hand.png")
    if isinstance(pictures, str):
        print(pictures)
    else:
        imsave(out / "guided_by_hand_scene.png", np.hstack(pictures))
        print(out / "guided_by_hand_scene.png")


def _guess(truth: Payload) -> Payload:
    return replace(truth, mass_kg=GUESS_KG, p_1c=truth.p_1i.mean(axis=0))


def _handle(truth: Payload) -> np.ndarray:
    """Return the position of the handle in {1} [m]: above the centre of mass, 79 mm above the grasps, at the bars."""
    return np.array([*truth.p_1c[:2], 0.079])


def read_estimate(path: Path) -> Payload:
    """Read an estimate that `mocobot estimate --out` wrote."""
    try:
        return Payload.of_estimate(mocobot.read_estimate(path))
    except InputError as error:
        raise InputError(f"{path}: not a usable estimate ({error})") from error


def make_estimate(payload: str, preset: str) -> Estimate:
    """Estimate the payload from one random and one static trial of the robots."""
    random = mocobot.simulate(payload, "random", vias=30, preset=preset)
    return mocobot.estimate([random, mocobot.simulate(payload, "static", preset=preset)])


def _score(preset: str, estimate: Estimate, truth: Payload) -> str:
    known = Payload.of_estimate(estimate)
    return (
        f"estimate by {preset} robots: mass {known.mass_kg:.3f} kg (true {truth.mass_kg:.3f}), centre of mass off by "
        f"{1e3 * np.linalg.norm(known.p_1c - truth.p_1c):.2f} mm"
    )


def guide(case: Case, grip_1: np.ndarray, grip: Grip) -> HandLog:
    """Run one trial of a case; the hands follow the same path in every case."""
    hand = GuidingHand(grip_1, PATH, BEGIN_S, grip)
    run_trial(
        case.scene, _stay(case.scene, hand.duration_s), case.gains,
        actors=[hand, *([case.arms] if case.arms else [])],
    )  # fmt: skip
    return hand.log()


def _stay(scene: TeamScene, duration_s: float) -> Trajectory:
    return Trajectory("static", np.tile(scene.wrist_home_b, (round(duration_s * RATE_HZ) + 1, 1, 1)))


def across_the_room(
    payload: str, case: Case, grip_1: np.ndarray
) -> tuple[HandLog, DriveLog, list[np.ndarray] | str]:
    """Run a trial with released bases: the wrists follow the person, and the bases follow the wrists."""
    scene = build_team(payload, case.scene.units, released=True)
    hand = GuidingHand(grip_1, ACROSS_THE_ROOM, 2.0)
    drive, snapshots = FollowingDrive(scene.mounts, scene.units), Snapshots([2.0, 5.5, hand.duration_s])
    run_trial(
        scene,
        _stay(scene, hand.duration_s),
        case.gains,
        actors=[drive, *([case.arms] if case.arms else []), hand, snapshots],
    )
    log, bases = hand.log(), drive.log()
    marks = []
    for t in snapshots.times_s[1:]:
        k = min(round(t * RATE_HZ), len(log.time) - 1)
        mark = Marks()
        mark.path(log.position[: k + 1 : 10], 0.006, (0.16, 0.44, 0.82, 1.0))
        # Force arrows: 0.15 m per N.
        mark.arrow(log.position[k], log.position[k] + 0.15 * log.force[k], 0.014, (0.85, 0.15, 0.15, 1.0))
        marks.append(mark)
    middle = log.position[0, :2]
    view = Camera((middle[0], middle[1] + 0.3, 0.45), 3.5, 200.0, -38.0)
    return log, bases, render(scene.compile(), snapshots.qpos[1:], view, marks, 1000, 800)


def _rms(rows: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(rows**2, axis=-1))))


def table(cases: Sequence[Case], logs: Sequence[Sequence[HandLog]], truth: Payload) -> str:
    """Tabulate the forces for the same motion, and the errors with softer hands."""
    lines = [
        f"\nweight of the payload {9.81 * truth.mass_kg:.1f} N; handle moved 60 mm aside, 40 mm up, by 6 deg, and back",
        "                                     the same motion: force [N]   moment [N m]   | hands of 1 kN/m:"
        "   at the hold, off by",
        "robots                                peak    rms   at hold       peak   at hold  | force rms [N]"
        "     height    angle",
    ]
    for case, (firm, soft) in zip(cases, logs, strict=True):
        move, hold = firm.time >= BEGIN_S, round((BEGIN_S + 3.4) * RATE_HZ)
        force, moment = np.linalg.norm(firm.force, axis=1), np.linalg.norm(firm.moment, axis=1)
        lines.append(
            f"{case.name:37s} {force[move].max():5.1f}  {_rms(firm.force[move]):5.1f} {force[hold]:9.2f}"
            f"    {moment[move].max():7.2f} {moment[hold]:9.2f}  | {_rms(soft.force[move]):13.1f}"
            f" {1e3 * (soft.position - soft.intended)[hold, 2]:7.1f} mm"
            f" {np.rad2deg(np.linalg.norm(soft.tilt[hold])):6.2f} deg"
        )
    return "\n".join(lines)


def journey(name: str, hand: HandLog, bases: DriveLog) -> str:
    """Describe the effort to lead the team through the room."""
    on = hand.time >= 2.0
    travelled = np.linalg.norm(bases.true[-1, :, :2] - bases.true[0, :, :2], axis=-1)
    way = 1e3 * np.linalg.norm(hand.intended[-1] - hand.intended[0])
    force, moment = np.linalg.norm(hand.force[on], axis=1), np.linalg.norm(hand.moment[on], axis=1)
    left = 1e3 * np.linalg.norm((hand.position - hand.intended)[-1])
    return (
        f"\nbases released ({name}), {way:.0f} mm across the room and 20 deg of yaw in 6 s:\n"
        f"force peak {force.max():.2f} N, rms {_rms(hand.force[on]):.2f} N; moment peak {moment.max():.2f} N m; "
        f"bases drove {', '.join(f'{d:.2f}' for d in travelled)} m; at the end the hands are off by {left:.1f} mm"
    )


def plot(cases: Sequence[Case], logs: Sequence[HandLog], hand: HandLog, bases: DriveLog, path: Path) -> None:
    """Plot the forces of every case over time, and the path through the room."""
    figure = Figure(figsize=(12, 7.5), layout="constrained")  # without pyplot, no display is needed
    axes = figure.subplot_mosaic([["force", "force", "room"], ["moment", "moment", "lead"]])
    colours = ("#6b7280", "#8b5cf6", "#e07b39", "#c2a100", "#2a9d8f", "#111827", "#2f6fd0")
    for case, log, colour in zip(cases, logs, colours, strict=False):
        on = log.time >= BEGIN_S - 0.5
        axes["force"].plot(log.time[on], np.linalg.norm(log.force[on], axis=1), color=colour, label=case.name)
        axes["moment"].plot(log.time[on], np.linalg.norm(log.moment[on], axis=1), color=colour)
    axes["force"].set(title="force that the same motion takes [N]", yscale="log", ylim=(0.02, 3000))
    axes["moment"].set(
        title="moment that the same motion takes [N m]", yscale="log", ylim=(0.005, 100), xlabel="t [s]"
    )
    axes["force"].legend(frameon=False, fontsize=8, ncols=2, loc="upper right")
    for i in range(bases.true.shape[1]):
        axes["room"].plot(*bases.true[:, i, :2].T, color=colours[2], label="bases" if not i else None)
    axes["room"].plot(*hand.position[:, :2].T, color=colours[6], label="handle")
    axes["room"].set(title="the way through the room [m]", aspect="equal")
    axes["room"].legend(frameon=False, fontsize=8)
    for k, name in enumerate("xyz"):
        axes["lead"].plot(hand.time, hand.force[:, k], color=colours[(6, 2, 4)[k]], label=name)
    axes["lead"].set(title="guiding force, bases following [N]", xlabel="t [s]")
    axes["lead"].legend(frameon=False, fontsize=8)
    for axis in axes.values():
        axis.grid(alpha=0.25)
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
