"""Simulate a team with payload (b), estimate the payload, and compare with the truth: a short version of the paper.

python scenarios/unknown_payload.py
"""

from __future__ import annotations

import mocobot


def main() -> None:
    """Estimate the payload from three trials with 16-bit encoders and noisy torques."""
    trials = [
        mocobot.simulate("b", "random", vias=40),
        mocobot.simulate("b", "periodic", duration_s=30),
        mocobot.simulate("b", "static"),
    ]
    print(mocobot.estimate(trials))

    truth = trials[0].truth
    print("\n[[Truth]]")
    print(f"    m {truth.mass_kg} kg, p_1c {truth.p_1c} m, principal moments {truth.principal_kgm2} kg m^2")


if __name__ == "__main__":
    main()
