"""What CMA-ES on trajectories and ``mujoco.sysid`` make of a set.

    pip install cma 'mujoco[sysid]'
    python benchmarks/commanded/baselines.py cma FOLDER --seconds 300
    python benchmarks/commanded/baselines.py sysid FOLDER --masses

Both simulate the whole of the two fitted runs from their commands (RK4 at 2 ms, one core) and fit reflected inertia,
Coulomb and viscous friction of every joint and one delay of all commands, from the maker's values on. CMA-ES does so as
PACE does: it draws candidates around the best ones (here in logarithms, between a tenth and ten times the start) and
takes those with the least mean square of positions. ``mujoco.sysid`` does Gauss-Newton steps on finite differences of
a thousandth in the same box, and shifts its predictions by the delay; its sensors tell the state before each step,
for which a step is added to that delay. Servos get no gain on velocity: their back-EMF
counts as viscous friction, which starts from the sum of both. With ``--masses`` both fit the links' masses, too.

Written into FOLDER: ``NAME.xml`` and ``NAME.json``, a control law for ``score.py``. Printed: its forecasts.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
import tyro

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # also runs as a file

from commanded import score
from commanded.drives import Array, ControlLaw, actuate
from commanded.forecast import Log, by_rollout, read_log, told_law
from commanded.machine import addresses, arriving

STEP_S, MOST, MOST_MASS, MOST_DELAY_S, SPREAD, DIFFERENCE = 2e-3, 10.0, 0.25, 0.04, 0.3, 1e-3
"""Step of the simulation, box around the start (a factor; a share of masses), largest delay, first spread of CMA-ES in
shares of the box' half, and relative step of differences."""
NAMES = (score.ARMATURE, score.COULOMB, score.VISCOUS)


@dataclass
class Problem:
    """What is fitted.

    Attributes:
        folder: the set.
        joints: their names.
        law: control law of the map, without a servo's gain on velocity.
        start: reflected inertia, Coulomb and viscous friction to start from, shape (3, J).
        logs: fitted runs.
        spec: the maker's model with the control law and position sensors.
        bodies: links whose masses are fitted.
    """

    folder: Path
    joints: tuple[str, ...]
    law: ControlLaw
    start: Array
    logs: list[Log]
    spec: mujoco.MjSpec
    bodies: list[str]

    @classmethod
    def read(cls, folder: Path, *, masses: bool) -> Problem:
        """The problem of a set."""
        servo = score.read_truth(folder)["kind"] == "arm"
        joints, told = told_law(folder)
        law = replace(told, kd=np.zeros(len(joints))) if servo else told
        spec = mujoco.MjSpec.from_file(str(folder / "model.xml"))
        spec.option.timestep, spec.option.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_RK4
        for own in [*spec.actuators]:
            spec.delete(own)
        actuate(spec, joints, law)
        for joint in joints:
            sensor = spec.add_sensor(name=f"{joint}_pos", objname=joint)
            sensor.type, sensor.objtype = mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtObj.mjOBJ_JOINT
        own = [spec.joint(joint) for joint in joints]
        start = np.array([[j.armature, j.frictionloss, j.damping[0]] for j in own]).T
        start[2] += told.kd - law.kd
        logs = [read_log(folder / f"fit_{k}.csv", joints) for k in range(2)]
        return cls(
            folder, joints, law, start, logs, spec, [b.name for b in spec.bodies[2:]] if masses else []
        )

    def changed(self, base: mujoco.MjSpec, values: Array, shares: Array) -> mujoco.MjSpec:
        """A copy of a model with values, shape (3, J), and masses that are shares of the maker's."""
        spec = base.copy()
        for name, (armature, coulomb, viscous) in zip(self.joints, values.T, strict=True):
            joint = spec.joint(name)
            joint.armature, joint.frictionloss, joint.damping = armature, coulomb, [viscous, 0.0, 0.0]
        for name, share in zip(self.bodies, shares, strict=True):
            body = spec.body(name)
            body.mass, body.inertia = share * body.mass, share * np.array(body.inertia)
        return spec

    def off(self, values: Array, shares: Array, delay_s: float) -> float:
        """Mean square of simulated minus measured positions [rad^2]."""
        m = self.changed(self.spec, values, shares).compile()
        at, _, adds = addresses(m, self.joints)
        squares = []
        for log in self.logs:
            start = np.zeros(m.nq + m.nv)
            start[at] = log.q[0]
            states = by_rollout(m, self.joints, log, delay_s)(start, 0.0, len(log.stamps) - 1)
            squares.append(np.mean((states[:, : m.nq] @ adds.T - log.q[1:]) ** 2))
        return float(np.mean(np.nan_to_num(squares, nan=1e3)))


Found = tuple[Array, Array, float, str]
"""Values, shape (3, J), shares of masses, delay [s], and a note on the search."""


def by_cma(problem: Problem, seconds: float) -> Found:
    """CMA-ES, which ends after so many seconds of CPU."""
    try:
        import cma  # pyright: ignore[reportMissingImports]
    except ImportError:
        sys.exit("The package cma is missing: pip install cma")
    size = problem.start.size

    def values_of(x: Array) -> tuple[Array, Array, float]:
        values = problem.start * MOST ** x[:size].reshape(problem.start.shape)
        return values, 1.0 + MOST_MASS * x[size:-1], 0.5 * MOST_DELAY_S * (x[-1] + 1.0)

    begun, count, trail = time.process_time(), 0, []
    first = np.append(np.zeros(size + len(problem.bodies)), -0.5)
    search = cma.CMAEvolutionStrategy(first, SPREAD, {"bounds": [-1, 1], "seed": 1, "verbose": -9})
    while not search.stop() and time.process_time() - begun < seconds:
        drawn = search.ask()
        search.tell(drawn, [problem.off(*values_of(x)) for x in drawn])
        count += len(drawn)
        trail.append(1e3 * np.sqrt(search.result.fbest))
    shown = ", ".join(f"{x:.2f}" for x in trail[:: max(1, len(trail) // 6)])
    ended = ", ".join(search.stop()) or "out of time"
    return (
        *values_of(search.result.xbest),
        f"{count} candidates, best rms [mrad] over time {shown}, {trail[-1]:.2f}; {ended}",
    )


def by_sysid(problem: Problem) -> Found:
    """``mujoco.sysid``, until it is satisfied."""
    from mujoco import sysid

    if not hasattr(sysid, "optimize"):
        sys.exit("What mujoco.sysid needs is missing: pip install 'mujoco[sysid]'")
    keys = [f"{name}:{joint}" for name in NAMES for joint in problem.joints]
    params, calls, model = sysid.ParameterDict(), 0, problem.spec.compile()
    for key, x in zip(keys, problem.start.ravel(), strict=True):
        params[key] = sysid.Parameter(key, x, x / MOST, x * MOST)
    for key in problem.bodies:
        params[key] = sysid.Parameter(key, 1.0, 1.0 - MOST_MASS, 1.0 + MOST_MASS)
    params[score.DELAY] = sysid.Parameter(score.DELAY, 0.25 * MOST_DELAY_S, 0.0, MOST_DELAY_S)

    def told(params: sysid.ParameterDict) -> tuple[Array, Array]:
        values = np.array([float(params[key].value[0]) for key in keys]).reshape(problem.start.shape)
        return values, np.array([float(params[key].value[0]) for key in problem.bodies])

    def build(params: sysid.ParameterDict, base: mujoco.MjSpec) -> mujoco.MjModel:
        nonlocal calls
        calls += 1
        return problem.changed(base, *told(params)).compile()

    transform = sysid.SignalTransform()
    transform.delay("*_pos", params[score.DELAY])
    starts, controls, sensors = [], [], []
    for log in problem.logs:
        clock = STEP_S * np.arange(round(log.stamps[-1] / STEP_S) + 2)
        held = np.zeros((len(clock) - 1, model.nu))
        held[:, : len(problem.joints)] = arriving(log.stamps, log.command, 0.0, clock)
        starts.append(sysid.create_initial_state(model, log.q[0]))
        controls.append(sysid.TimeSeries.from_control_names(clock[:-1], held, model))
        sensors.append(sysid.TimeSeries.from_names(log.stamps, log.q, model))
    runs = [f"fit_{k}" for k in range(len(problem.logs))]
    residual = sysid.build_residual_fn(
        models_sequences=[sysid.ModelSequences("robot", problem.spec, runs, starts, controls, sensors)],
        build_model=build,
        modify_residual=transform.apply,
        n_threads=1,
    )
    found, result = sysid.optimize(
        params, residual, optimizer="scipy", verbose=False, x_scale="jac", max_iters=40, diff_step=DIFFERENCE
    )
    values, shares = told(found)
    share = values / problem.start
    stuck = int(((share < 1.001 / MOST) | (share > MOST / 1.001)).sum())
    note = f"{calls} models, {stuck} of {values.size} values at a bound; {result.message}"
    return values, shares, float(found[score.DELAY].value[0]) + STEP_S, note


def main(
    which: tyro.conf.Positional[Literal["cma", "sysid"]],
    folder: tyro.conf.Positional[Path],
    seconds: float = 300.0,
    masses: bool = False,
) -> None:
    """Fit a set and judge it.

    Args:
        which: program.
        folder: a set that make.py wrote.
        seconds: of CPU that CMA-ES may take.
        masses: fit the links' masses, too.
    """
    problem, begun = Problem.read(folder, masses=masses), time.process_time()
    values, shares, delay, note = by_cma(problem, seconds) if which == "cma" else by_sysid(problem)
    print(f"{which}: {time.process_time() - begun:.0f} s of CPU, {note}")
    truth = score.read_truth(folder)
    for name, row in zip(NAMES, values, strict=True):
        true = np.array([own[name] for own in truth["joints"].values()])
        if truth["kind"] == "arm" and name == score.VISCOUS:
            true += [own["kd"] - own["kp"] * own["loop_delay_s"] for own in truth["joints"].values()]
        print(f"  {name} over truth: " + " ".join(f"{x:.3f}" for x in row / true))
    print(
        f"  delay {1e3 * delay:.2f} ms, true {1e3 * next(iter(truth['joints'].values()))['delay_s']:.2f} ms"
    )
    spec = problem.changed(problem.spec, values, shares)
    for own in [*spec.actuators, *spec.sensors]:
        spec.delete(own)
    spec.compile()
    fitted, control = folder / f"{which}.xml", folder / f"{which}.json"
    fitted.write_text(spec.to_xml(), encoding="utf-8")
    told = {"kp": problem.law.kp.tolist(), "kd": problem.law.kd.tolist(), "delay_s": delay}
    control.write_text(json.dumps(told), encoding="utf-8")
    score.main(score.Options(folder, fitted, control=control))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
