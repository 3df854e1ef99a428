"""Picture of docs/diagnosis/method.md, made anew: python docs/site/method_picture.py

An arm of three joints in MuJoCo, whose model lacks friction in all joints and a rotor: power of the rows by band, what
the causes would gain with nothing and with the likeliest set in the model, and the evidence of the sets between.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import mujoco
import numpy as np
from matplotlib.axes import Axes

from discrepancy.evidence.search import Search, State
from discrepancy.joints.diagnose import Outcome, diagnose

ROOT = Path(__file__).resolve().parents[2]
JOINT, BARS, DPI = 1, 8, 120
GREY, BLUE, RED = "0.6", "tab:blue", "tab:red"


def found() -> Outcome:
    """What a diagnosis finds in two logs of 24 s."""
    sys.path.insert(0, str(ROOT / "tests" / "helpers"))
    from followed_arm import arm_log, arm_model, rubs

    def true(spec: mujoco.MjSpec) -> None:
        rubs(0.5, 0.3)(spec)
        spec.joint("elbow").armature = 0.08

    with tempfile.TemporaryDirectory() as folder:
        return diagnose(arm_model(Path(folder)), [arm_log(true, 2), arm_log(true, 3)])


def main() -> None:
    """Draw it."""
    outcome = found()
    search, full = outcome.search, outcome.state
    plain = outcome.nothing or search
    empty = plain.fixed(())
    sets = [search.fixed(full.chosen[:n]) for n in range(len(full.chosen) + 1)]
    mpl.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    figure, (power, gain, steps) = plt.subplots(1, 3, figsize=(11.5, 3.4), layout="constrained")
    _power(power, outcome, empty)
    _gain(gain, _best(plain, empty), _best(search, full))
    names = ["nothing", *(f"+ {c.group.cause}\n{c.group.place}" for c in full.chosen)]
    steps.plot([s.evidence - sets[0].evidence for s in sets], "o-", color=BLUE)
    steps.set_xticks(range(len(names)), names)
    steps.set_xlim(-0.4, len(names) - 0.6)
    steps.set_title("Evidence of the sets [nats]")
    figure.savefig(ROOT / "docs" / "img" / "diagnosis_method.png", dpi=DPI)


def _power(axes: Axes, outcome: Outcome, empty: State) -> None:
    channel, edges = outcome.problem.cells.channels[JOINT], outcome.problem.cells.bands.edges_hz
    modelled = channel.squares / outcome.problem.cells.rows[JOINT]
    for variance, colour, label in (
        (modelled, GREY, "residual as modelled"),
        (empty.posterior.variance[JOINT], RED, "noise learnt with nothing found"),
        (outcome.state.posterior.variance[JOINT], BLUE, "noise learnt with the causes"),
        (outcome.search.floor[JOINT], "black", "floor"),
    ):
        axes.stairs(np.sqrt(variance), edges, color=colour, label=label, baseline=None, linewidth=1.6)
    axes.set_yscale("log")
    axes.set_xlabel("Hz")
    axes.set_title(f"Rows of joint {outcome.problem.model.joints[JOINT]}: rms by band [N m]")
    axes.legend(frameon=False, fontsize=8)


def _best(search: Search, state: State) -> dict[str, float]:
    """What each cause would gain at each place in its best shape, the most last."""
    return {f"{c.group.cause}, {c.group.place}": gain for gain, c in reversed(search.offers(state))}


def _gain(axes: Axes, before: dict[str, float], after: dict[str, float]) -> None:
    names = sorted(before, key=lambda name: before[name])[-BARS:]
    place = np.arange(len(names))
    axes.barh(place + 0.2, [before[n] for n in names], 0.4, color=RED, label="with nothing in the model")
    axes.barh(
        place - 0.2, [after.get(n, 0.0) for n in names], 0.4, color=BLUE, label="with the likeliest set"
    )
    axes.set_yticks(place, names)
    axes.set_title("Gain of one more cause [nats]")
    axes.legend(frameon=False, fontsize=8, loc="lower right")


if __name__ == "__main__":
    main()
