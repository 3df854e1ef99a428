"""What every named cause is worth on the EMPS recordings, beside plain least squares.

    python benchmarks/emps/emps_gain.py

Force (inverse), position and voltage (reference resimulated in closed loop): in sample, on held-out blocks, and on the
whole second recording, which nothing was fitted to but the pulses that its own diagnosis finds.
"""

from __future__ import annotations

import numpy as np

from discrepancy.emps.catalogue import candidate_of
from discrepancy.emps.diagnosis import diagnose_axis
from discrepancy.emps.laws.rig import LawfulEmpsRig
from discrepancy.emps.recording.reader import read_emps
from discrepancy.emps.rig import EmpsRig
from discrepancy.emps.staircase import Active, errors, format_staircase, staircase
from emps_data import DATA, PULSES, needed_folder

PUBLISHED = {"mass": 94.7, "viscous_friction": 203.0, "coulomb_friction": 20.5, "force_offset": -3.2}
"""An independent least squares, position filtered at 40 Hz: 3.4 % of the force left."""
FIRST_LAG_S = 1e-3


def plain_fit(rig: EmpsRig, names: tuple[str, ...]) -> Active:
    """Ordinary least squares on the force's rows, nothing whitened."""
    causes = [candidate_of(name, rig.hints) for name in names]
    columns = [np.concatenate(rig.physical(cause))[:, 0] for cause in causes]
    force = np.concatenate(rig.reduction(rig.signals.residual))[:, 0]
    values = np.linalg.lstsq(np.concatenate(columns, axis=1), force, rcond=None)[0]
    return [(cause, np.array([value])) for cause, value in zip(causes, values, strict=True)]


def given(rig: EmpsRig, values: dict[str, float]) -> Active:
    """A model from known numbers; the mass in whole."""
    known = values | {"mass": values["mass"] - rig.nominal.mass_kg}
    return [(candidate_of(name, rig.hints), np.array([value])) for name, value in known.items()]


def main() -> None:
    """Print the staircase and the models beside it."""
    folder = needed_folder()
    rig, other = (LawfulEmpsRig.of(read_emps(folder / name)) for name in (DATA, PULSES))
    there = diagnose_axis(other).explanation
    injected = [(f.candidate, f.values) for f in there.found if f.candidate.cause == "injected_voltage"]
    found = diagnose_axis(rig).explanation
    print(f"{DATA} diagnosed; {PULSES} with the pulses found there\n")
    print(format_staircase(staircase(rig, found, (other, injected)), PULSES))
    lag = candidate_of("velocity_lag", rig.hints), np.array([FIRST_LAG_S])
    models = {
        "published four": given(rig, PUBLISHED),
        "plain, offset": plain_fit(rig, ("mass", "coulomb_friction", "viscous_friction", "force_offset")),
        "plain, asymmetric": plain_fit(
            rig, ("mass", "coulomb_friction", "viscous_friction", "asymmetric_viscous")
        ),
    }
    print(f"\nplain least squares, with a velocity {1e3 * FIRST_LAG_S:g} ms old in the loop")
    for name, model in models.items():
        for which, extra in ((rig, []), (other, injected)):
            e = errors(which, [[*model, lag, *extra]] * len(which.blocks))
            values = ", ".join(f"{c.cause} {v[0]:.4g}" for c, v in model) if which is rig else ""
            print(
                f"{name:<20}{which.log.name:<22}force {e.force_percent:.2f} %, position {e.position_um:.3g} um, "
                f"voltage {e.voltage_mV:.4g} mV  {values}"
            )
    bare = errors(other, [[(f.candidate, f.values) for f in found.found]] * len(other.blocks))
    print(
        f"\nthe diagnosed model on {PULSES} without pulses: force {bare.force_percent:.2f} %, position "
        f"{bare.position_um:.3g} um, voltage {bare.voltage_mV:.4g} mV"
    )
    for name, explanation, which in ((DATA, found, rig), (PULSES, there, other)):
        print(f"\n{name}")
        for item in explanation.found:
            values, se = which.effect_parameters(item.candidate, item.values, item.covariance)
            numbers = ", ".join(f"{k} = {v:.6g} +- {se[k]:.2g}" for k, v in values.items())
            print(f"    {item.candidate.cause:<20}{numbers}")


if __name__ == "__main__":
    main()
