"""Judge a fit of a set: forecasts of the held-out run, and parameters against the truth.

    python benchmarks/commanded/score.py FOLDER --fitted FOLDER/out/as_found.xml --result FOLDER/out/calibration.json

Forecasts start from measured states and know the commands only (``forecast.py``). They are made with the fitted model,
the maker's, the true one as far as MJCF holds it, and the true machine with its own friction and firmware. A fitted
model brings its actuators, or it gets the control law of the map, with the numbers that the result has in its place.
Without ``--fitted``, the others alone are forecast. ``--oracle`` adds standard errors that a fit cannot beat.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
import tyro

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # also runs as a file

from commanded.drives import Array, ControlLaw, actuate
from commanded.forecast import by_machine, by_rollout, compiled, errors, read_log, told_law
from commanded.machine import Machine, addresses
from commanded.rubbing import Law

ARMATURE, COULOMB, VISCOUS, DELAY = "armature_kgm2", "coulomb_Nm", "viscous_Nms_per_rad", "delay_s"
KP, KD = ("position_gain", "kp"), ("velocity_gain", "kd")
"""Names of parameters in a result; those of gains may have a unit behind them."""
Parameters = dict[tuple[str, str], dict[str, Any]]
MASS_SHARE = 0.1 / np.sqrt(3.0)
"""Standard deviation of the masses of a leg's model, for the oracle."""


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        folder: a set that ``make.py`` wrote.
        fitted: the fitted MJCF.
        result: the fit's JSON with a list ``parameters`` of place, parameter (or name), value, se and determined.
        control: JSON with kp, kd, limit and delay_s of the fit, where the result does not have them.
        oracle: print standard errors of the best possible fit.
    """

    folder: tyro.conf.Positional[Path]
    fitted: Path | None = None
    result: Path | None = None
    control: Path | None = None
    oracle: bool = False


@dataclass(frozen=True)
class Scored:
    """A parameter beside the truth.

    Attributes:
        place, name: as in the result.
        value, se: as fitted.
        truth: true value.
        determined: what the result says.
    """

    place: str
    name: str
    value: float
    se: float
    truth: float
    determined: bool

    @property
    def z(self) -> float:
        """Error over standard error."""
        return (self.value - self.truth) / self.se


def read_truth(folder: Path) -> dict[str, Any]:
    """``truth.json`` of a set."""
    return json.loads((folder / "truth.json").read_text(encoding="utf-8"))


def _each(truth: dict[str, Any], name: str) -> Array:
    return np.array([joint[name] for joint in truth["joints"].values()], float)


def true_machine(folder: Path) -> Machine:
    """The machine that wrote the logs."""
    truth = read_truth(folder)
    joints, servo = tuple(truth["joints"]), truth["kind"] == "arm"
    kp, kd, most = (_each(truth, n) for n in ("kp", "kd", "limit_Nm"))
    spec = mujoco.MjSpec.from_file(str(folder / "true.xml"))
    for own in [*spec.actuators]:
        spec.delete(own)
    law = Law(**{name: np.array(value) for name, value in truth["friction_law"].items()})
    for j, name in enumerate(joints):
        spec.joint(name).frictionloss = law.factor[j] * law.base[j]
        spec.joint(name).damping = [law.viscous[j], 0.0, 0.0]
    actuate(spec, joints, ControlLaw(kp, kd, most, apart=servo), firmware=servo)
    delay = truth["bus_delay_s"]
    return Machine(spec.compile(), joints, law, delay, servo, kp, most, truth["counts_per_turn"])


def parameters_of(result: Path | None) -> Parameters:
    """Parameters of a result by place and name."""
    if result is None:
        return {}
    listed = json.loads(result.read_text(encoding="utf-8"))["parameters"]
    return {(p["place"], p.get("parameter") or p["name"]): p for p in listed}


def _found(parameters: Parameters, joint: str, stem: str | tuple[str, ...]) -> dict[str, Any] | None:
    """The parameter of a joint, or else of the whole robot, whose name begins so."""
    joints = {place for place, name in parameters if name == ARMATURE}
    own = {place: p for (place, name), p in parameters.items() if name.startswith(stem)}
    return own.get(joint) or next((p for place, p in own.items() if place not in joints), None)


def fitted_model(folder: Path, options: Options) -> tuple[mujoco.MjModel, Array]:
    """The fitted model with its control law, and the delay of commands [s], shape (J,).

    The model's own actuators are taken if they make position loops. Else the law is that of the map, with what the
    result or the file of the control law has instead.
    """
    assert options.fitted is not None
    joints, law = told_law(folder)
    found = parameters_of(options.result)
    numbers = {"kp": law.kp.copy(), "kd": law.kd.copy(), "delay_s": np.zeros(len(joints))}
    for j, joint in enumerate(joints):
        for key, stem in (("kp", KP), ("kd", KD), ("delay_s", f"command_{DELAY}")):
            if (one := _found(found, joint, stem)) is not None:
                numbers[key][j] = one["value"]
    law = replace(law, **numbers)
    if options.control is not None:
        told = json.loads(options.control.read_text(encoding="utf-8"))
        law = replace(law, **{key: np.array(value) for key, value in told.items()})
    own = mujoco.MjModel.from_xml_path(str(options.fitted))
    loops = own.nu >= len(joints) and (own.actuator_biastype[: len(joints)] > 0).all()
    model = compiled(options.fitted, joints, None if loops else law)
    return model, np.broadcast_to(law.delay_s, len(joints))


def forecasts(folder: Path, options: Options) -> dict[str, dict[str, Array]]:
    """Rms of forecast minus measured position per joint [rad], by model and window; the set keeps its own."""
    truth = read_truth(folder)
    joints, law = told_law(folder)
    log = read_log(folder / "held_out.csv", joints)

    def by(path: Path, control: ControlLaw | None, delay: float | Array) -> dict[str, Array]:
        m = compiled(path, joints, control)
        return errors(m, joints, by_rollout(m, joints, log, delay), log)

    kept, out = folder / "forecast.json", {}
    if kept.is_file():
        told = json.loads(kept.read_text(encoding="utf-8"))
        out = {which: {window: np.array(x) for window, x in own.items()} for which, own in told.items()}
    else:
        machine = true_machine(folder)
        out["truth"] = errors(machine.model, joints, by_machine(machine, log), log)
        out["true.xml"] = by(folder / "true.xml", None, _each(truth, "delay_s"))
        out["model.xml"] = by(folder / "model.xml", law, 0.0)
        plain = {which: {window: x.tolist() for window, x in own.items()} for which, own in out.items()}
        kept.write_text(json.dumps(plain), encoding="utf-8")
    if options.fitted is not None:
        m, delay = fitted_model(folder, options)
        out["fitted"] = errors(m, joints, by_rollout(m, joints, log, delay), log)
    return out


def ratio(own: Array, reference: Array) -> float:
    """Forecast error over that of a reference: root mean square over the joints."""
    return float(np.sqrt(np.mean((own / reference) ** 2)))


def scored(folder: Path, options: Options) -> list[Scored]:
    """Physical parameters beside the truth.

    The gain on velocity of a servo counts as it acts: less than the back-EMF by what the firmware's period takes. If
    the result has none, viscous friction has to make up for what the map's is off. Coulomb and viscous friction count
    where the true friction is these two.
    """
    truth, out = read_truth(folder), []
    _, law = told_law(folder)
    parameters, plain = parameters_of(options.result), truth["law"] == "M1"
    acts = _each(truth, "kd") - _each(truth, "kp") * _each(truth, "loop_delay_s")
    told = law.kd * _each(truth, "kp") / law.kp
    for j, (joint, own) in enumerate(truth["joints"].items()):
        gain = _found(parameters, joint, KD)
        wanted = {ARMATURE: own[ARMATURE], f"command_{DELAY}": own[DELAY], KP: own["kp"], KD: acts[j]}
        if plain:
            wanted[COULOMB] = own[COULOMB]
            wanted[VISCOUS] = own[VISCOUS] + (0.0 if gain else acts[j] - told[j])
        for stem, value in wanted.items():
            if (p := _found(parameters, joint, stem)) is not None:
                name = p.get("parameter") or p["name"]
                out.append(Scored(p["place"], name, p["value"], p["se"], value, bool(p["determined"])))
    for body, mass in truth["masses"].items():
        if (p := parameters.get((body, "mass_kg"))) is not None:
            out.append(Scored(body, "mass_kg", p["value"], p["se"], mass, bool(p["determined"])))
    return list({(s.place, s.name): s for s in out}.values())  # a delay of all joints once


def curve_errors(folder: Path, options: Options) -> Array:
    """Error of each joint's friction over speed, a share of the curve: rms over the speeds of the fitted runs.

    MuJoCo tells what the fitted model and its drives, without an error of position, set against a speed. The true
    drives' part is taken off, so that what a fit has too much or too little there counts as friction. All torques share
    the error of the position gain, which is taken off, too. The true curve is the mean over the loads of the runs.
    """
    truth, out = read_truth(folder), []
    m, _ = fitted_model(folder, options)
    joints = tuple(truth["joints"])
    at, dof, _ = addresses(m, joints)
    data = mujoco.MjData(m)

    def against(speeds: Array) -> Array:
        data.qpos[:], data.qvel[:] = m.qpos0, 0.0
        data.qvel[dof], data.ctrl[: len(joints)] = speeds, data.qpos[at]
        mujoco.mj_forward(m, data)
        return -(data.qfrc_passive + data.qfrc_actuator)[dof]

    acts = _each(truth, "kd") - _each(truth, "kp") * _each(truth, "loop_delay_s")
    rest = against(np.zeros(len(joints)))
    gain = m.actuator_gainprm[: len(joints), 0] * m.actuator_gear[: len(joints), 0] ** 2 / _each(truth, "kp")
    for j, own in enumerate(truth["joints"].values()):
        curve = {
            name: np.array(own["friction"][name], float) for name in ("speed_rads", "torque_Nm", "samples")
        }
        only = np.eye(len(joints))[j]
        off = [
            (m.dof_frictionloss[dof[j]] + (against(v * only) - rest)[j]) / gain[j] - acts[j] * v - torque
            for v, torque in zip(curve["speed_rads"], curve["torque_Nm"], strict=True)
        ]
        size = np.average(curve["torque_Nm"] ** 2, weights=curve["samples"])
        out.append(np.sqrt(np.average(np.square(off), weights=curve["samples"]) / size))
    return np.array(out)


def oracle(folder: Path) -> dict[tuple[str, str], tuple[float, float]]:
    """True value and least standard error of each parameter, by place and name.

    By the slopes of the two fitted runs, simulated from their first states with the true model, noise and rounding of
    the encoder being independent errors; all else is known. A leg's masses are known as its maker's are.
    """
    truth = read_truth(folder)
    joints = tuple(truth["joints"])
    base = compiled(folder / "true.xml", joints, None)
    at, dof, adds = addresses(base, joints)
    logs = [read_log(folder / f"fit_{k}.csv", joints) for k in range(2)]
    delay = _each(truth, DELAY)
    value: dict[tuple[str, str], float] = {("all", DELAY): float(delay[0])}
    for joint, own in truth["joints"].items():
        value |= {(joint, name): own[name] for name in (ARMATURE, COULOMB, VISCOUS)}
    if truth["kind"] == "leg":
        value |= {(body, "mass_kg"): mass for body, mass in truth["masses"].items()}

    def positions(changed: dict[tuple[str, str], float]) -> Array:
        m, late, out = compiled(folder / "true.xml", joints, None), delay, []
        for (place, name), x in changed.items():
            if name == DELAY:
                late = delay + x - value[place, name]
            elif name == "mass_kg":
                share = x / m.body(place).mass[0]
                m.body(place).mass *= share
                m.body(place).inertia *= share
            else:
                array = {ARMATURE: m.dof_armature, COULOMB: m.dof_frictionloss, VISCOUS: m.dof_damping}[name]
                array[dof[joints.index(place)]] = x
        mujoco.mj_setConst(m, mujoco.MjData(m))
        for log in logs:
            start = np.zeros(m.nq + m.nv)
            start[at] = log.q[0]
            states = by_rollout(m, joints, log, late)(start, 0.0, len(log.stamps) - 1)
            out.append(states[:, : m.nq] @ adds.T)
        return np.vstack(out).ravel()

    slopes = []
    for key, x in value.items():
        step = 1e-3 if key[1] == DELAY else 0.02 * x
        slopes.append((positions({key: x + step}) - positions({key: x - step})) / (2.0 * step))
    J = np.array(slopes)
    counts = 2.0 * np.pi / truth["counts_per_turn"]
    H = J @ J.T / (truth["noise_rad"] ** 2 + counts**2 / 12.0)
    for i, ((_, name), x) in enumerate(value.items()):
        if name == "mass_kg":
            H[i, i] += 1.0 / (MASS_SHARE * x) ** 2
    se = np.sqrt(np.diag(np.linalg.inv(H)))
    return {key: (x, float(s)) for (key, x), s in zip(value.items(), se, strict=True)}


def main(options: Options) -> None:
    """Print forecasts, ratios and parameters."""
    begun = time.process_time()
    found = forecasts(options.folder, options)
    print(f"{options.folder}: forecast error, rms [mrad] ({time.process_time() - begun:.1f} s)")
    for which, own in found.items():
        for window, off in own.items():
            cells = "".join(f"{1e3 * x:8.2f}" for x in off)
            print(f"  {which:<10}{window:>6}{cells}   {ratio(off, found['truth'][window]):6.2f} of truth")
    if options.fitted is not None:
        cells = "".join(f"{100.0 * x:7.1f}" for x in curve_errors(options.folder, options))
        print(f"  friction over speed is off by [%]{cells}")
    listed = scored(options.folder, options)
    for s in listed:
        said = "" if s.determined else "  not determined"
        print(
            f"  {s.place:<16}{s.name:<22}{s.value:10.4g} +- {s.se:8.2g}  truth {s.truth:8.4g}  {s.z:6.1f}{said}"
        )
    if told := [s.z for s in listed if s.determined]:
        share = np.mean(np.abs(told) < 3.0)
        print(f"  {len(told)} determined: rms {np.sqrt(np.mean(np.square(told))):.2f}, {share:.0%} within 3")
    if options.oracle:
        for (place, name), (x, se) in oracle(options.folder).items():
            print(f"  oracle: {place:<16}{name:<22}{x:10.4g} +- {se:8.2g} ({100.0 * se / x:.2g} %)")


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
