"""The same fit with ``mujoco.sysid``: same axis, same four numbers (mass, Coulomb, viscous forwards and backwards).

    pip install 'mujoco[sysid]'
    python benchmarks/emps/emps_sysid.py

``mujoco.sysid`` fits the closed loop of the MJCF by non-linear least squares on position and voltage; the diagnosis'
problem is linear in the force, whitened as in a diagnosis or plain. All are judged alike: by force, and by the digital
loop, resimulated.
"""

from __future__ import annotations

import time

import mujoco
import numpy as np
from mujoco import sysid

from discrepancy.emps.catalogue import candidate_of
from discrepancy.emps.diagnosis import block_rows
from discrepancy.emps.recording.reader import read_emps
from discrepancy.emps.rig import EmpsRig
from discrepancy.emps.staircase import Active, errors
from discrepancy.least_squares.block_errors import block_covariance, part_of
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from emps_data import DATA, PULSES, needed_folder
from emps_gain import plain_fit
from mocobot_sim.emps.mjcf import CARRIAGE, JOINT, axis_spec
from mocobot_sim.emps.plant import Plant

NAMES = ("mass", "coulomb_friction", "viscous_friction", "asymmetric_viscous")
LAG_S = 1e-3
"""Age of the loop's velocity in the comparison's closed loop, for both."""


def ours(rig: EmpsRig) -> tuple[np.ndarray, np.ndarray, float]:
    """Mass, Coulomb, viscous forwards and backwards, their standard errors, and seconds from the rig's rows on."""
    start = time.perf_counter()
    candidates = [candidate_of(name, rig.hints) for name in (*NAMES, "velocity_lag")]
    problem = Problem.of(rig.rows(candidates), candidates)
    fit = Fit.of(problem, range(len(candidates)))
    covariance = block_covariance(fit, block_rows(rig))
    values = np.array([fit.part(k)[0][0] * candidates[k].units[0] for k in range(4)])
    whole = np.zeros((4, 4))
    at = [problem.spans[k].start for k in range(4)]
    units = np.array([candidates[k].units[0] for k in range(4)])
    whole[:] = covariance[np.ix_(at, at)] * np.outer(units, units)
    assert np.isclose(whole[0, 0], part_of(fit, covariance, 0)[0, 0] * units[0] ** 2)
    to = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 1.0], [0, 0, 1.0, -1.0]])
    numbers = to @ values + np.array([rig.nominal.mass_kg, 0, 0, 0])
    return numbers, np.sqrt(np.diag(to @ whole @ to.T)), time.perf_counter() - start


def theirs(rig: EmpsRig) -> tuple[np.ndarray, np.ndarray, float, int]:
    """The same from ``mujoco.sysid``, with 95 % half widths over 1.96, and the number of residuals it computed."""
    guess = rig.nominal
    # Both one-way dampers must be there before anything is compiled; what they are to begin with does not matter.
    spec = axis_spec(
        Plant(**{**guess.__dict__, "coulomb_N": (10.0, 10.0), "viscous_Ns_per_m": (100.0, 101.0)})
    )
    calls = 0

    def build(params: sysid.ParameterDict, base: mujoco.MjSpec) -> mujoco.MjModel:
        nonlocal calls
        calls += 1
        mass, coulomb, forward, backward = params.as_vector()
        edited = base.copy()
        edited.body(CARRIAGE).mass = mass
        edited.joint(JOINT).frictionloss = coulomb
        edited.joint(JOINT).damping = [forward, 0.0, 0.0]
        edited.actuator("viscous_backward").biasprm = [0.0, 0.0, forward - backward, *[0.0] * 7]
        # A damper that helps and one that resists push to the same side only if the range follows the sign.
        edited.actuator("viscous_backward").forcerange = [0.0, 1e9] if backward > forward else [-1e9, 0.0]
        return edited.compile()

    model = spec.compile()
    names, states, controls, sensors = [], [], [], []
    for name, block in zip(rig.trials, rig.blocks, strict=True):
        log, signals = rig.log, rig.signals
        clock = log.time[block] - log.time[block.start]
        control = np.column_stack([log.reference[block], np.zeros(len(clock))])
        measured = np.column_stack([log.position[block], signals.v[block], log.voltage[block]])
        names.append(name)
        start = np.array([signals.x[block.start]]), np.array([signals.v[block.start]])
        states.append(sysid.create_initial_state(model, *start))
        controls.append(sysid.TimeSeries.from_control_names(clock, control, model))
        sensors.append(sysid.TimeSeries.from_names(clock, measured, model))
    sequences = sysid.ModelSequences("emps", spec, names, states, controls, sensors)
    params = sysid.ParameterDict()
    for name, nominal, low, high in (
        ("mass", guess.mass_kg, 50.0, 200.0), ("coulomb", 10.0, 0.0, 100.0), ("forward", 100.0, 0.0, 1000.0),
        ("backward", 101.0, 0.0, 1000.0),
    ):  # fmt: skip
        params[name] = sysid.Parameter(name, nominal, low, high)
    residual = sysid.build_residual_fn(
        models_sequences=[sequences],
        build_model=build,
        enabled_observations=[
            ("position", sysid.SignalType.MjSensor), ("voltage", sysid.SignalType.MjSensor)
        ],
    )  # fmt: skip
    start = time.perf_counter()
    found, result = sysid.optimize(params, residual, optimizer="scipy", verbose=False, x_scale="jac")
    spent = time.perf_counter() - start
    final = residual(found.as_vector(), found)[0]
    _, half = sysid.calculate_intervals(final, np.asarray(result.jac))
    return found.as_vector(), np.asarray(half) / 1.96, spent, calls


def model_of(rig: EmpsRig, numbers: np.ndarray) -> Active:
    """The four numbers as causes, with the loop's velocity lag."""
    mass, coulomb, forward, backward = numbers
    values = (
        mass - rig.nominal.mass_kg,
        coulomb,
        0.5 * (forward + backward),
        0.5 * (forward - backward),
        LAG_S,
    )
    return [
        (candidate_of(name, rig.hints), np.array([value]))
        for name, value in zip((*NAMES, "velocity_lag"), values, strict=True)
    ]


def main() -> None:
    """Print both fits side by side."""
    folder = needed_folder()
    rigs = [EmpsRig.of(read_emps(folder / name)) for name in (DATA, PULSES)]
    injected = candidate_of("injected_voltage", rigs[1].hints), np.array([5.0695])
    a, a_se, a_s = ours(rigs[0])
    start = time.perf_counter()
    plain = np.array([float(values[0]) for _, values in plain_fit(rigs[0], NAMES)])
    plain = np.array([rigs[0].nominal.mass_kg + plain[0], plain[1], plain[2] + plain[3], plain[2] - plain[3]])
    plain_s = time.perf_counter() - start
    b, b_se, b_s, calls = theirs(rigs[0])
    print(f"{'':<26}{'rows, whitened':>22}{'rows, plain':>14}{'mujoco.sysid':>22}")
    for k, name in enumerate(("mass [kg]", "Coulomb [N]", "viscous forwards [N s/m]", "viscous backwards")):
        print(f"{name:<26}{a[k]:>12.3f} +- {a_se[k]:<6.3f}{plain[k]:>14.3f}{b[k]:>12.3f} +- {b_se[k]:<6.3f}")
    print(f"{'seconds':<26}{a_s:>16.2f}{plain_s:>20.2f}{b_s:>16.1f}   ({calls} models built and simulated)")
    for rig, extra in zip(rigs, ([], [injected]), strict=True):
        for name, numbers in (("rows, whitened", a), ("rows, plain", plain), ("mujoco.sysid", b)):
            e = errors(rig, [[*model_of(rig, numbers), *extra]] * len(rig.blocks))
            print(
                f"{rig.log.name:<24}{name:<16}force {e.force_percent:.2f} %, position {e.position_um:.3g} um, "
                f"voltage {e.voltage_mV:.4g} mV"
            )


if __name__ == "__main__":
    main()
