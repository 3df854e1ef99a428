"""Where one fit is better than the paper's stages, and where it gives way to them.

    python benchmarks/one_fit.py

Payload (c), nominal sensors, three trials of one seed: first with robots that are off by shares of the ``uncalibrated``
preset's errors of encoder zeros, springs and torque zeros, then with one thing wrong in the random trial. Prints the
largest errors of both methods in the frames that the encoders define, and which of them ``auto`` takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import tyro

import mocobot
from calibration import Truth, of_estimate, score
from mocobot_sim.scene.as_built import AsBuilt

SHARES = (0.0, 0.003, 0.01, 0.1, 1.0)
TRIALS = ({"trajectory": "random"}, {"trajectory": "periodic"}, {"trajectory": "static"})
ERRORS = ("R_deg", "p_mm", "com_mm", "m_percent", "I_percent")
WRONG = (
    "nothing", "stuck for 2 s", "stuck for 20 s", "a spike", "a slip of 0.1 deg", "friction of 0.003 N m",
    "friction of 0.01 N m",
)  # fmt: skip


def main(seed: int = 7102) -> None:
    """Simulate, estimate both ways, print."""
    print(f"{'':<24}{'taken':<8}" + "".join(f"{name + ': stages, fit':>26}" for name in ERRORS))
    for share in SHARES:
        row(f"share {share:g}", made(seed, units=off_by(share, seed)))
    for wrong in WRONG:
        row(wrong, damaged(wrong, made(seed, friction_Nm=friction(wrong)), seed))


def off_by(share: float, seed: int) -> tuple[AsBuilt, ...]:
    """Three robots with a share of one draw of the preset's errors, lengths as designed."""
    spread = mocobot.PRESETS["uncalibrated"].spread
    shared = replace(
        spread,
        geometry_m=0.0,
        encoder_zero_rad=share * spread.encoder_zero_rad,
        stiffness_ratio=share * spread.stiffness_ratio,
        tau_zero_Nm=share * spread.tau_zero_Nm,
    )
    return shared.draw(3, np.random.default_rng(seed))


def friction(wrong: str) -> float:
    """Coulomb friction [N m] that a name asks for, in the second driven joint of the second robot."""
    return float(wrong.split()[2]) if wrong.startswith("friction") else 0.0


def made(
    seed: int, units: Sequence[AsBuilt] = (), friction_Nm: float = 0.0
) -> list[mocobot.SimulatedRecording]:
    """Three trials."""
    rubbing = {"coulomb_Nm": friction_Nm, "viscous_Nms_per_rad": 0.0}
    effects = [mocobot.make_effect("joint_friction", rubbing, robot=2, joint=2)] if friction_Nm else []
    return [
        mocobot.simulate("c", seed=seed, number=number, units=units, effects=effects, **trial)
        for number, trial in enumerate(TRIALS, start=1)
    ]


def damaged(
    wrong: str, recordings: list[mocobot.SimulatedRecording], seed: int
) -> list[mocobot.SimulatedRecording]:
    """The first trial with a driven angle of the second robot stuck, spiked or slipped amid it."""
    first = recordings[0]
    phi, middle = first.phi.copy(), len(first.phi) // 2
    if wrong.startswith("stuck"):
        stop = middle + round(float(wrong.split()[2]) * first.metadata.rate_hz)
        phi[middle:stop, 1, 1] = phi[middle, 1, 1]
    elif wrong == "a spike":
        phi[middle, 1, 1] += 1.0
    elif wrong.startswith("a slip"):
        phi[middle:, 1, 1] += np.deg2rad(0.1)
    return [replace(first, phi=phi), *recordings[1:]]


def row(name: str, recordings: list[mocobot.SimulatedRecording]) -> None:
    """Print one."""
    truth = Truth.of(recordings[0].truth.to_dict())
    scored = []
    for method in ("staged", "fit"):
        found = of_estimate(mocobot.estimate(recordings, method=method))
        scored.append(score(found, truth, truth.scale) if found else dict.fromkeys(ERRORS, np.nan))
    taken = "fit" if not mocobot.estimate(recordings).why_not_fit else "stages"
    pairs = (f"{scored[0][key]:.3g}, {scored[1][key]:.3g}" for key in ERRORS)
    print(f"{name:<24}{taken:<8}" + "".join(f"{pair:>26}" for pair in pairs), flush=True)


if __name__ == "__main__":
    tyro.cli(main)
