"""How often a joint in the payload is named rightly, wrongly with certainty, or where there is none.

    python benchmarks/two_body_verdicts.py --first 1 --sets 10 --rigid 20

Every set has a payload of its own: place and number of the grasps, who holds which body, joint, masses, spring and
damper are drawn. Robots are calibrated in every other set. A random and a periodic trial are read. A set counts if the
true joint, fitted where it is, gains 30 nats over one rigid body. A payload that the grasps do not hold is drawn again.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from discrepancy.team.two_bodies import find_joint
from estimator.errors import InputError
from estimator.recording.model import Recording
from estimator.two_bodies.relative import Halves, candidates, trial_rows
from estimator.two_bodies.team import Motion
from mocobot_sim.errors import TrialError
from mocobot_sim.trial.sensors import PRESETS
from mocobot_sim.trial.simulate import TrialRequest, simulate

KINDS = ("hinged", "sliding", "flexible", "folding")
LEAST_NATS, CERTAIN = 30.0, 0.9
DIVISIONS = {3: ((1,), (2,), (1, 2)), 4: ((2, 3),)}
"""Robots (from 0) that hold the second body; four robots fold a table."""


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        first: seed of the first set; the others follow.
        sets: sets of each kind of joint.
        rigid: sets with one rigid body.
        kinds: kinds of joint.
        whole: run the whole diagnosis instead of the search for a joint.
    """

    first: int = 1
    sets: int = 10
    rigid: int = 20
    kinds: tuple[str, ...] = KINDS
    whole: bool = False


@dataclass(frozen=True)
class Drawn:
    """A payload: its MJCF, motion of its joint, and halves (robots from 1)."""

    xml: str
    motion: Motion
    halves: Halves


def draw(kind: str, rng: np.random.Generator) -> Drawn:
    """Draw a payload; ``kind`` is one of ``KINDS`` or rigid."""
    robots = 4 if kind == "folding" else 3
    angle = (
        rng.uniform(0.0, 2.0 * np.pi)
        + 2.0 * np.pi * (np.arange(robots) + rng.uniform(-0.12, 0.12, robots)) / robots
    )
    places = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(robots)]) * rng.uniform(0.5, 0.75)
    second = () if kind == "rigid" else DIVISIONS[robots][rng.integers(len(DIVISIONS[robots]))]
    first = tuple(i for i in range(robots) if i not in second)
    z = rng.uniform(0.04, 0.12)
    middle = [places[list(half)].mean(axis=0) if half else np.zeros(3) for half in (first, second)]
    tilt = {"hinged": rng.uniform(0.0, 35.0), "sliding": rng.uniform(65.0, 90.0), "flexible": rng.uniform(0.0, 70.0),
            "folding": rng.uniform(82.0, 90.0), "rigid": 0.0}[kind]  # fmt: skip
    across = (
        np.cross(middle[1] - middle[0], [0.0, 0.0, 1.0]) if kind == "folding" else np.array([1.0, 0.0, 0.0])
    )
    heading = np.arctan2(across[1], across[0]) + (0.1 if kind == "folding" else np.pi) * rng.uniform(
        -1.0, 1.0
    )
    tilt = np.deg2rad(tilt)
    axis = np.array([np.sin(tilt) * np.cos(heading), np.sin(tilt) * np.sin(heading), np.cos(tilt)])
    pivot = 0.5 * (middle[0] + middle[1]) + [*rng.uniform(-0.08, 0.08, 2), z]
    shift = places[0].copy()  # the frame of the payload is the first grasp

    def body(half: tuple[int, ...], at: np.ndarray) -> str:
        com = at + rng.uniform(-0.1, 0.1, 3) * [1.0, 1.0, 0.4] + [0.0, 0.0, z] - shift
        m, (a, b, c) = rng.uniform(2.5, 6.5), rng.uniform(0.15, 0.35, 3)  # a box of these half sides
        moments = m / 3.0 * np.array([b * b + 0.1 * c * c, a * a + 0.1 * c * c, a * a + b * b])
        sites = []
        for i in half:
            turn = 0.0 if i == 0 else rng.uniform(-np.pi, np.pi)
            quat = f"{np.cos(turn / 2)} 0 0 {np.sin(turn / 2)}"
            sites.append(f'<site name="grasp{i + 1}" pos="{_row(places[i] - shift)}" quat="{quat}"/>')
        return f'<inertial pos="{_row(com)}" mass="{m}" diaginertia="{_row(moments)}"/>' + "".join(sites)

    law = f'damping="{rng.uniform(0.02, 0.3)}"'
    if kind == "flexible":
        law = f'damping="{rng.uniform(0.5, 2.0)}" stiffness="{np.exp(rng.uniform(np.log(40.0), np.log(200.0)))}"'
    if kind == "sliding":
        law = f'damping="{rng.uniform(0.5, 6.0)}"'
    own = body(first, middle[0])
    if second:
        type_ = "slide" if kind == "sliding" else "hinge"
        joint = f'<joint name="joint" type="{type_}" pos="{_row(pivot - shift)}" axis="{_row(axis)}" {law}/>'
        own += f'<body name="second">{joint}{body(second, middle[1])}</body>'
    xml = (
        f'<mujoco><compiler angle="radian"/><worldbody><body name="payload">{own}</body></worldbody></mujoco>'
    )
    said = tuple(i + 1 for i in first), tuple(i + 1 for i in second)
    motion: Motion = "rigid" if kind == "rigid" else "sliding" if kind == "sliding" else "hinged"
    return Drawn(xml, motion, said)


def _row(values: np.ndarray) -> str:
    return " ".join(f"{x:.9g}" for x in values)


def make(kind: str, seed: int, preset: str) -> tuple[Drawn, list[Recording], int]:
    """Draw a payload that the robots hold, and simulate it; also the number of payloads that they did not hold."""
    rng = np.random.default_rng([seed, (*KINDS, "rigid").index(kind)])
    for dropped in range(20):
        drawn = draw(kind, rng)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{kind}.xml"
            path.write_text(drawn.xml)
            requests = [
                TrialRequest(str(path), trial, seed, vias=16, duration_s=20.0)
                for trial in ("random", "periodic")
            ]
            try:
                return drawn, [simulate(r, [PRESETS[preset]]).recordings[preset] for r in requests], dropped
            except (TrialError, InputError) as error:
                print(f"  not held: {str(error)[:110]}", flush=True)
    raise SystemExit(f"{kind} {seed}: no payload of 20 is held")


def main(options: Options) -> None:
    """Print a line for each set and a table."""
    table = []
    for kind in (*options.kinds, *["rigid"] * bool(options.rigid)):
        counts = dict.fromkeys(("worth", "named", "sprung", "false", "silent"), 0)
        number = options.rigid if kind == "rigid" else options.sets
        for seed in range(options.first, options.first + number):
            preset = ("nominal", "uncalibrated")[seed % 2]
            drawn, recordings, dropped = make(kind, seed, preset)
            found, worth = _look(recordings, options.whole), np.inf
            if kind != "rigid":
                right, rigid = (
                    candidates(trial_rows(recordings), (m,), drawn.halves)[0] for m in (drawn.motion, "rigid")
                )
                worth = right.log_evidence - rigid.log_evidence
                size = f"worth {worth:.0f} nats, misfit {rigid.noise:.3g} / {right.noise:.3g}, {right.q_rms:.2g} rms"
            else:
                size = "rigid"
            said, probability, sprung = found or ("silent", 0.0, False)
            correct = said == f"{drawn.motion} {drawn.halves}"
            counts["worth"] += worth >= LEAST_NATS
            if worth >= LEAST_NATS:
                counts["named"] += correct
                counts["sprung"] += correct and sprung
                counts["silent"] += found is None
                counts["false"] += not correct and probability >= CERTAIN
            print(f"{kind} {seed} {preset}: {drawn.motion} {drawn.halves}, {size} -> {said} {probability:.2f}"
                  f"{', spring' * sprung}; {dropped} not held", flush=True)  # fmt: skip
        table.append(f"| {kind} | {number} | {' | '.join(str(n) for n in counts.values())} |")
    print("| payload | sets | worth 30 nats | named rightly | with a spring | falsely certain | silent |")
    print("\n".join(["| --- " * 7 + "|", *table]))


def _look(recordings: list[Recording], whole: bool) -> tuple[str, float, bool] | None:
    """Look for a joint: what is named, its probability, and whether a spring is told; None if silent."""
    if whole:
        import mocobot

        two = mocobot.diagnose(recordings).found
        two = two if hasattr(two, "joint") else None
    else:
        two = find_joint(recordings)
    if two is None:
        return None
    sprung = two.estimate is not None and "stiffness" in two.estimate.law
    return f"{two.joint.motion} {two.joint.halves}", two.values["causes"][0]["probability"], sprung


if __name__ == "__main__":
    main(tyro.cli(Options))
