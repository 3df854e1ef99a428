"""Which effects explain the scatter of the paper's Tables II-V: python benchmarks/paper_scatter.py [OUT]

Six effects of a healthy Omnid act alone on the uncalibrated team of seed 0, at three sizes. The variances that they add
are scaled to fit Tables II and III, alone and in pairs, where variances add; IV and V are then predicted. A second fit
is that of all four tables. The best set of each is simulated in full. Eight other teams give the spread of the means.

Stages are kept in OUT (default out/paper_scatter) and not repeated. One process, about 25 minutes of a core.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.errors import InputError
from estimator.estimate.payload import estimate_from_trials, trial_of
from mocobot_sim.effects import Effect, make_effect
from mocobot_sim.paper.experiment import _grasps
from mocobot_sim.paper.measured import ENTRIES, agreement, effective_freedom, entry
from mocobot_sim.paper.scoring import PAYLOADS, payload_truth, published_errors, score
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.simulate import Simulated, TrialRequest, simulate

PRESET = sensor_preset("uncalibrated")
KINDS = ("random", "static", "periodic")
SIZES = {
    "encoder_play": (1e-3, 3e-3, 9e-3), "zero_scatter": (1e-3, 3e-3, 9e-3), "base_creep": (3e-5, 1e-4, 3e-4),
    "base_compliance": (3e-6, 1e-5, 3e-5), "sea_hysteresis": (0.05, 0.15, 0.45), "joint_friction": (0.05, 0.15, 0.45),
}  # fmt: skip
"""Three sizes of each effect [rad, rad, m/s, m/N, N m, N m]; the middle one is the reference."""
LARGEST = {name: sizes[2] for name, sizes in SIZES.items()}
"""Largest fitted size: nothing is extrapolated upwards."""
ON_TORQUES = ("sea_hysteresis", "joint_friction")
IN_READINGS = ("encoder_play", "zero_scatter")
TEAMS = range(1, 9)
Key = tuple[str, str, int]
"""Payload, kind and number of a trial."""


def effects(name: str, size: float, key: Key) -> list[Effect]:
    """One effect on every robot and joint; what differs between trials is drawn from the trial's key."""
    words = [PAYLOADS.index(key[0]), KINDS.index(key[1]), key[2]]
    place = 1 + words[0] + 4 * (words[1] + 3 * words[2])
    joints = [(robot, joint) for robot in (1, 2, 3) for joint in (1, 2, 3)]
    parameter = {
        "encoder_play": "play_rad", "base_compliance": "compliance_m_per_N", "sea_hysteresis": "friction_Nm",
        "joint_friction": "coulomb_Nm",
    }.get(name, "")  # fmt: skip
    if name == "zero_scatter":
        both = {"phi_rad": size, "theta_rad": size, "draw": place}
        return [make_effect(name, both, robot) for robot in (1, 2, 3)]
    if name == "base_creep":
        speeds = np.clip(size * np.random.default_rng([9, *words]).standard_normal((3, 2)), -1e-3, 1e-3)
        return [make_effect(name, {"x_mps": x, "y_mps": y}, k) for k, (x, y) in enumerate(speeds.tolist(), 1)]
    if name == "base_compliance":
        return [make_effect(name, {parameter: size}, robot) for robot in (1, 2, 3)]
    return [make_effect(name, {parameter: size}, *place) for place in joints]


def misread(done: Simulated, name: str, sizes: Sequence[float], key: Key) -> Iterator[Any]:
    """Recordings of a simulated trial with an effect on readings, which leaves the motion as it is (or nearly so)."""
    sensed = done.log.sensed
    for size in sizes:
        phi, theta = sensed.phi, sensed.theta.copy()
        if name == "encoder_play":
            y = theta[0].copy()
            for k, x in enumerate(sensed.theta):
                np.clip(y, x - size / 2, x + size / 2, out=y)
                theta[k] = y
        else:
            zeros = np.stack([e.zeros(1) for e in effects(name, size, key)])  # type: ignore[attr-defined]
            phi, theta = phi + zeros[:, 0], theta + zeros[:, 1]
        log = replace(done.log, sensed=replace(sensed, phi=phi, theta=theta))
        rng = TrialRequest(*key[:2], 0, key[2]).rng(f"sensors {PRESET.name}")
        yield measure(log, PRESET, rng, key[0], 0, f"{key[0]}_{key[1]}{key[2]}")


def estimated(trials: Sequence[Any], payload: str) -> dict[str, Any]:
    """Scores of the staged estimate, or of the joint one if there are no static holds."""
    data = [trial_of(trial) for trial in trials]
    try:
        return score(estimate_from_trials(data, "staged"), payload_truth(payload))
    except InputError as error:
        print(f"  {payload}: {error}", flush=True)
        return score(estimate_from_trials(data, "joint"), payload_truth(payload))


def runs(
    payload: str,
    made: Callable[[Key], list[Effect]],
    counts: tuple[int, int, int],
    seed: int = 0,
    short: float = 1.0,
) -> list[tuple[Key, Simulated]]:
    """Simulate random trials, then static and periodic ones from the grasps that they determine."""
    done: list[tuple[Key, Simulated]] = []
    held = None
    for kind, count in zip(KINDS, counts, strict=True):
        if kind == "static" and count:
            p, R = _grasps(np.zeros(1), [one.recordings[PRESET.name] for _, one in done])
            held = RigidTransform.from_components(p, Rotation.from_matrix(R))
        for k in range(count):
            key = (payload, kind, k)
            request = TrialRequest(payload, kind, seed, k, round(80 * short), 60.0 * short)
            # The draw of each zero is in the effect itself, so the place says nothing more.
            done.append((key, simulate(request, [PRESET], held, effects=made(key), place=1)))
    return done


def scored(payload: str, done: Sequence[tuple[Key, Simulated]]) -> dict[str, Any]:
    """Scores of simulated trials."""
    return estimated([one.recordings[PRESET.name] for _, one in done], payload)


def first_pass() -> dict[str, Any]:
    """Scores by effect, size and payload; ``clean`` is without any effect."""
    found: dict[str, Any] = {"clean": {}}
    for payload in PAYLOADS:
        done = runs(payload, lambda _: [], (6, 1, 3))
        found["clean"][payload] = scored(payload, done)
        for name in IN_READINGS:
            each = [list(misread(one, name, SIZES[name], key)) for key, one in done]
            for k, size in enumerate(SIZES[name]):
                found.setdefault(f"{name} {size:g}", {})[payload] = estimated([e[k] for e in each], payload)
        del done
        for name in SIZES.keys() - set(IN_READINGS):
            for size in SIZES[name] if payload == "a" else SIZES[name][1:2]:
                # Bases that creep faster leave no static holds, and wrenches that the estimator refuses.
                counts = (3, 0, 0) if name == "base_creep" and size > SIZES[name][0] else (3, 1, 3)
                mine = runs(payload, lambda key, n=name, s=size: effects(n, s, key), counts)
                found.setdefault(f"{name} {size:g}", {})[payload] = scored(payload, mine)
        print(f"payload {payload}: {time.process_time():.0f} s of a core", flush=True)
    return found


def teams() -> dict[str, Any]:
    """Scores of other teams of the uncalibrated preset, by seed and payload, with one shorter trial of each kind."""
    found = {}
    for seed in TEAMS:
        found[str(seed)] = {p: scored(p, runs(p, lambda _: [], (1, 1, 1), seed, 0.25)) for p in PAYLOADS}
        print(f"team {seed}: {time.process_time():.0f} s of a core", flush=True)
    return found


def kept(folder: Path, name: str, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Result of a stage, from its file if it is there."""
    file = folder / f"{name}.json"
    if not file.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(make(), indent=1))
    return json.loads(file.read_text())


def spread_of(scores: Mapping[str, Any]) -> dict[str, Any]:
    """Standard deviations of the means over teams in the form of ``agreement``'s argument ``teams``."""
    spread: dict[str, Any] = {}
    for table, paths in ENTRIES.items():
        means = np.array([[[entry(of[p], e)[0] for e in paths] for p in PAYLOADS] for of in scores.values()])
        spread[table] = {"freedom": round(effective_freedom(means.reshape(len(means), -1)), 1)}
        deviations = np.std(means, axis=0, ddof=1)
        spread[table] |= {p: [float(f"{x:.3g}") for x in deviations[k]] for k, p in enumerate(PAYLOADS)}
    return spread


class Model:
    """Scores with effects of any size: variances add, and each effect's share is scaled from its middle size."""

    def __init__(self, first: Mapping[str, Any], names: Sequence[str]) -> None:
        self.first, self.names, self.power = first, names, {}
        for name in names:
            low, middle, high = (
                self._added(name, first[f"{name} {size:g}"]["a"], "a") for size in SIZES[name]
            )
            grown = max(high, 1e-9) / max(low, 1e-9) if low > 0.0 else max(high, 1e-9) / max(middle, 1e-9)
            ratio = SIZES[name][2] / SIZES[name][0 if low > 0.0 else 1]
            self.power[name] = float(np.clip(np.log(grown) / np.log(ratio) / 2.0, 0.5, 2.0))

    def _added(self, name: str, scores: Mapping[str, Any], payload: str) -> float:
        """Added variance over the published one, mean of Tables II and III, or of V for what acts on torques."""
        shares = []
        for path in ENTRIES["V"] if name in ON_TORQUES else (*ENTRIES["II"], *ENTRIES["III"]):
            clean, theirs = (
                entry(of, path)[1] for of in (self.first["clean"][payload], published_errors(payload))
            )
            shares.append((entry(scores, path)[1] ** 2 - clean**2) / theirs**2)
        return float(np.mean(shares))

    def scores(self, sizes: Mapping[str, float]) -> dict[str, Any]:
        """Predicted scores by payload, entries of ``ENTRIES`` only."""
        found: dict[str, Any] = {}
        for payload in PAYLOADS:
            found[payload] = {"all": {}}
            for path in (path for paths in ENTRIES.values() for path in paths):
                mean, std = clean = entry(self.first["clean"][payload], path)
                variance = (std or 0.0) ** 2
                for name, size in sizes.items():
                    middle = SIZES[name][1]
                    share = (size / middle) ** self.power[name]
                    at = entry(self.first[f"{name} {middle:g}"][payload], path)
                    mean += share * ((clean[0] if at[0] is None else at[0]) - clean[0])
                    variance += share**2 * max(0.0, (at[1] or 0.0) ** 2 - (std or 0.0) ** 2)
                value: Any = {"mean": mean, "std": variance**0.5} if std else mean
                if path.startswith("all."):
                    found[payload]["all"][path[4:]] = value
                else:
                    found[payload][path] = value
        return found


def chi2s(scores: Mapping[str, Any], spread: Mapping[str, Any]) -> dict[str, list[float]]:
    """Means and scatter chi-squares of each table, and the ratio of scatters."""
    return {
        one.table: [one.means, one.scatter or 0.0, one.ratio or 0.0, one.means_p, one.scatter_p or 0.0]
        for one in agreement(scores, 6, True, spread)
    }


def total(found: Mapping[str, list[float]], tables: Sequence[str]) -> float:
    """Sum of the chi-squares of means and scatter."""
    return sum(found[table][0] + found[table][1] for table in tables)


def fitted(
    model: Model, names: Sequence[str], spread: Mapping[str, Any], tables: Sequence[str]
) -> dict[str, float]:
    """Sizes with the least sum of the chi-squares of some tables."""

    def cost(logs: np.ndarray) -> float:
        sizes = {n: min(float(np.exp(x)), LARGEST[n]) for n, x in zip(names, logs, strict=True)}
        return total(chi2s(model.scores(sizes), spread), tables)

    grids = [np.log(SIZES[name][1]) + np.log([0.1, 0.5, 1.0, 3.0, 10.0]) for name in names]
    start = min((np.array(at) for at in product(*grids)), key=cost)
    best = minimize(cost, start, method="Nelder-Mead", options={"xatol": 0.01, "fatol": 0.01}).x
    return {n: min(float(np.exp(x)), LARGEST[n]) for n, x in zip(names, best, strict=True)}


def full(sizes: Mapping[str, float]) -> dict[str, Any]:
    """Scores of the paper's trials with several effects at once."""

    def made(key: Key) -> list[Effect]:
        return [effect for name, size in sizes.items() for effect in effects(name, size, key)]

    return {payload: scored(payload, runs(payload, made, (6, 1, 3))) for payload in PAYLOADS}


def line(name: str, sizes: Mapping[str, float], found: Mapping[str, list[float]]) -> str:
    """One row: sizes, then means and scatter chi-square of each table."""
    shown = ", ".join(f"{n} {x:.2g}" for n, x in sizes.items()) or "none"
    numbers = "  ".join(f"{t}: {v[0]:6.1f} {v[1]:6.1f} x{v[2]:4.1f}" for t, v in found.items())
    return f"{name:9} {shown:48} {numbers}"


def main() -> None:
    """Run all stages and print the table."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/paper_scatter")
    first = kept(folder, "first", first_pass)
    spread = spread_of(kept(folder, "teams", teams))
    print(json.dumps(spread))
    names = [name for name, sizes in SIZES.items() if all(first[f"{name} {sizes[1]:g}"].values())]
    for name in SIZES.keys() - set(names):
        print(f"{name}: no estimate from {SIZES[name][1]:g} on, so it is in no fit")
    model = Model(first, names)
    print({name: round(power, 2) for name, power in model.power.items()})
    print(line("clean", {}, chi2s(first["clean"], spread)))
    best = {}
    for tables in (("II", "III"), tuple(ENTRIES)):
        print(f"fitted on Tables {', '.join(tables)}")
        rows = []
        for one in (*combinations(names, 1), *combinations(names, 2)):
            sizes = fitted(model, one, spread, tables)
            found = chi2s(model.scores(sizes), spread)
            rows.append((total(found, tables), sizes))
            print(line("predicted", sizes, found), flush=True)
        best[len(tables)] = min(rows, key=lambda row: row[0])[1]
    for sizes in (best[4], best[2]):
        rounded = {n: float(f"{x:.2g}") for n, x in sizes.items()}
        name = "full " + " ".join(f"{n}={x:g}" for n, x in rounded.items())
        print(
            line("simulated", rounded, chi2s(kept(folder, name, lambda s=rounded: full(s)), spread)),
            flush=True,
        )
    print(f"{time.process_time():.0f} s of a core")


if __name__ == "__main__":
    main()
