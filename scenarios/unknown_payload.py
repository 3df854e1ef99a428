"""Carry payload (b), record, estimate it, and compare with the truth: the paper's experiment in one short script.

python scenarios/unknown_payload.py
"""

from __future__ import annotations

from estimator.estimate.payload import estimate_payload
from estimator.estimate.text import format_estimate
from mocobot_sim.trial.sensors import sensor_preset
from mocobot_sim.trial.simulate import TrialRequest, simulate


def main() -> None:
    """Three trials with 16-bit encoders and noisy torques, one estimate."""
    nominal = sensor_preset("nominal")
    requests = [
        TrialRequest("b", "random", vias=40),
        TrialRequest("b", "periodic", duration_s=30),
        TrialRequest("b", "static"),
    ]
    trials = [simulate(request, [nominal]) for request in requests]
    estimate = estimate_payload([trial.recordings["nominal"] for trial in trials])
    print(format_estimate(estimate))

    truth = trials[0].truth
    print("\n[[Truth]]")
    print(f"    m {truth.mass_kg} kg, p_1c {truth.p_1c} m, principal moments {truth.principal_kgm2} kg m^2")


if __name__ == "__main__":
    main()
