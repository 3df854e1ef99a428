"""Run a campaign: simulate every set, diagnose it blind and store the result; stored sets are not run again.

Folder of a campaign:

config.json        values that determine the results of its sets, as text by name; other values need another folder
sets/KEY.json      result of a set: ``set`` (``CampaignSet.to_dict``), ``error`` (why there is no verdict, or null),
                   ``unexpected`` (whether the error is a fault of the program), ``truth`` (``simulate_set``),
                   ``verdict`` (keys of ``discrepancy.result.json`` that the score needs) and, for a clean set,
                   ``limits`` {places, pushes} (``push_limits``); a failure leaves no partial file
campaign.json, sets.csv, report.txt, provenance.json
                   summary of all sets, written last
"""

import json
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from discrepancy.team.causes import CAUSES, default_tolerances, read_tolerances
from discrepancy.team.diagnosis import diagnose_team
from discrepancy.team.told import TeamDiagnosed
from estimator.calibrate.calibration import Calibration
from estimator.errors import InputError
from estimator.extras import draws_plots
from estimator.files import ends_with_this, file_facts, make_folder, write_json, write_text
from estimator.recording.model import Recording
from estimator.strict import read_json
from mocobot.api.recordings import Robots, calibration_of, quiet, recordings_of
from mocobot.api.simulation import simulate_trials
from mocobot.campaign.effects import (
    SPREAD_IN_UNCALIBRATED,
    Ground,
    MeasuredLimits,
    cheaper,
    draw_at,
    draw_background,
    gimbal_axes,
    push_limits,
)
from mocobot.campaign.summary import csv_table, format_campaign, summarise
from mocobot.checks import CONFIG, CONFIG_FORMAT, inputs_of
from mocobot.cluster import workers_of
from mocobot.options import CampaignOptions
from mocobot.results import NAME, folder_provenance, provenance, run_key
from mocobot_sim.effects import EFFECTS, Effect, effect_to_dict
from mocobot_sim.errors import TrialError
from mocobot_sim.scene.as_built import AsBuilt, read_units
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.trial.sensors import sensor_preset
from mocobot_sim.trial.simulate import TrialRequest, make_trajectory
from mocobot_sim.trial.trajectories import Trajectory

SETS, SUMMARY, REPORT, TABLE, VERSION = "sets", "campaign.json", "report.txt", "sets.csv", 1
RESULT = "the result of a campaign's set"
NO_MATTER = ("out", "json", "pictures", "force", "jobs", "scheduler", "sets")
"""Options that do not affect the result of a set."""
FILES = ("payload", "units", "calibration", "tolerances")
"""Options that may name a file; the configuration records its hash."""
Json = dict[str, Any]
KEPT = ("verdict", "causes", "suspected", "scatter", "residual", "notes")
"""Keys of a diagnosis that a set's result keeps; the score does not need the others, which are large."""


@dataclass(frozen=True, kw_only=True)
class CampaignPlan(CampaignOptions):
    """Everything that determines the results of a campaign, with all files read; equal plans give equal bits.

    In addition to its background, every team has deviations that are drawn from the tolerances.

    Attributes:
        units: robots of the background ``units``.
        calibration: calibration that the diagnosis uses; None for the robots as recorded.
        tolerances: tolerances of a healthy robot, standard deviations by cause and parameter.
    """

    units: tuple[AsBuilt, ...] = ()
    calibration: Calibration | None = None
    tolerances: Mapping[str, Mapping[str, float]] = field(default_factory=default_tolerances)

    @classmethod
    def of(cls, options: CampaignOptions) -> "CampaignPlan":
        """Make the plan of the given options.

        Raises:
            InputError: the preset draws its own robots, the payload has two bodies, or the number of units does not
                fit it.
        """
        if not sensor_preset(options.preset).calibrated:
            raise InputError(
                f"preset is {options.preset}, which draws robots of its own; use nominal, and --background uncalibrated"
            )
        units = () if options.units is None else read_units(options.units)
        team = build_team(options.payload)
        robots = team.robots
        if team.payload_joint() is not None:
            raise InputError(
                f"payload is {options.payload}, which has two bodies; a campaign needs a rigid payload"
            )
        if units and len(units) != robots:
            raise InputError(
                f"{options.units}: has {len(units)} robots; the payload {options.payload} is carried by {robots}"
            )
        values = {each.name: getattr(options, each.name) for each in fields(CampaignOptions)}
        return cls(**values | {
            "units": units, "tolerances": read_tolerances(options.tolerances),
            "calibration": None if options.calibration is None else calibration_of(options.calibration),
        })  # fmt: skip

    @property
    def backgrounds(self) -> tuple[str, ...]:
        """Kinds of robots: ``calibrated`` (as designed), ``uncalibrated`` (drawn for every team) or ``units``."""
        return ("units",) if self.units else self.background

    def clean_sets(self) -> list["CampaignSet"]:
        """List one set without hidden effect for every team."""
        return [CampaignSet(b, team) for b in self.backgrounds for team in range(1, self.teams + 1)]

    def hidden_sets(self) -> list["CampaignSet"]:
        """List the sets with a hidden effect; a larger number of sets only appends to the list."""
        return [
            CampaignSet(b, k % self.teams + 1, k + 1, cause, self.sizes[k % len(self.sizes)])
            for b in self.backgrounds
            for k, cause in enumerate(self._in_turn(self.candidates(b), b))
        ]

    def candidates(self, background: str) -> list[str]:
        """List the causes that can be hidden in a background, without those that act on all its robots anyway."""
        has = () if background == "calibrated" or self.calibration is not None else SPREAD_IN_UNCALIBRATED
        names = self.causes or tuple(CAUSES)
        return [name for name in names if name in EFFECTS and name not in (*has, *self.exclude)]

    def _in_turn(self, names: Sequence[str], background: str) -> list[str]:
        """Repeat the names, in a new random order each time, up to the number of sets."""
        out: list[str] = []
        while names and len(out) < self.sets:
            rng = self.rng(background, "turn", len(out) // len(names))
            out += [names[int(k)] for k in rng.permutation(len(names))]
        return out[: self.sets]

    def rng(self, *purpose: object) -> np.random.Generator:
        """Return an independent random generator for one purpose."""
        return np.random.default_rng([self.seed, *" ".join(map(str, purpose)).encode()])


@dataclass(frozen=True)
class CampaignSet:
    """One set of recordings of a team.

    Attributes:
        background: kind of robots, see ``CampaignPlan.backgrounds``.
        team: number of the team from 1.
        number: number from 1 among the background's sets with a hidden effect; None for a clean set.
        cause: hidden cause, or None.
        factor: size of the cause over its detection limit, or None.
    """

    background: str
    team: int
    number: int | None = None
    cause: str | None = None
    factor: float | None = None

    @property
    def key(self) -> str:
        """Name of the set, also that of its file."""
        if self.number is None:
            return f"{self.background}-team{self.team}-clean"
        return f"{self.background}-{self.number:04}-team{self.team}-{self.cause}-x{self.factor:g}"

    @property
    def clean(self) -> "CampaignSet":
        """Clean set of the same team, which provides its detection limits."""
        return CampaignSet(self.background, self.team)

    def to_dict(self) -> dict[str, Any]:
        """Return the attributes and the key as plain values."""
        return {"key": self.key, **vars(self)}


class CampaignStore:
    """Stores the result of every set in the folder of a campaign.

    Attributes:
        out: folder of the campaign.
    """

    def __init__(self, out: Path, config: Mapping[str, str], *, force: bool = False) -> None:
        """Open the folder of a campaign, or create it.

        Args:
            out: folder of the campaign.
            config: values that determine the results of its sets, by name.
            force: whether to delete the results of a campaign with another configuration.

        Raises:
            InputError: the folder holds such a campaign and ``force`` is not set.
        """
        self.out = out
        file = out / CONFIG
        if file.is_file() and (what := _difference(_read(file), config)):
            if not force:
                raise InputError(
                    f"{out}: holds a campaign with {what}; give --force to drop it, or name a new folder"
                )
            for result in (out / SETS).glob("*.json"):
                if read_json(result, RESULT).get("set", {}).get("key") == result.stem:
                    result.unlink()
            file.unlink()
        make_folder(out / SETS)
        if not file.is_file():
            write_json(file, {"format": CONFIG_FORMAT, "version": VERSION, "config": dict(config)})

    def has(self, one: CampaignSet) -> bool:
        """Whether the result of a set is stored."""
        return self.file(one).is_file()

    def get(self, one: CampaignSet) -> dict[str, Any]:
        """Read the result of a set.

        Raises:
            InputError: the file cannot be read or belongs to another set.
        """
        found = read_json(self.file(one), RESULT)
        if found.get("set") != json.loads(json.dumps(one.to_dict())):
            raise InputError(f"{self.file(one)}: is not the result of that set; delete it")
        return found

    def put(self, result: Mapping[str, Any]) -> None:
        """Store the result of a set."""
        write_json(self.out / SETS / f"{result['set']['key']}.json", result)

    def file(self, one: CampaignSet) -> Path:
        """Path of the result of a set."""
        return self.out / SETS / f"{one.key}.json"


def _read(file: Path) -> dict[str, Any]:
    values = read_json(file, "what a campaign is of")
    config = values.get("config")
    if values.get("format") != CONFIG_FORMAT or not isinstance(config, dict):
        raise InputError(f"{file}: is not of a campaign; name a new folder")
    return config


def _difference(there: Mapping[str, Any], here: Mapping[str, str]) -> str:
    """Describe the first value that differs; empty if all are equal."""
    for name in here:
        if there.get(name) != here[name]:
            if name == "code":
                return "another version of mocobot or of its libraries"
            return f"{name} {there.get(name)}, not {here[name]}"
    return ""


def simulate_set(
    plan: CampaignPlan, one: CampaignSet, limits: MeasuredLimits | None
) -> tuple[list[Recording], dict[str, Any]]:
    """Simulate the recordings of a set.

    Args:
        plan: plan of the campaign.
        one: set to simulate.
        limits: detection limits, of which effect sizes are multiples; None for a clean set.

    Returns:
        Recordings without truth, and the truth: ``effects``, ``units``, ``gimbal_axes_1`` and ``control`` (stability
        of the control in each trial).

    Raises:
        InputError: the team's recordings cannot show the effect anywhere, or its size is out of range.
        TrialError: the physics of a trial cannot be trusted.
    """
    nominal = build_team(plan.payload)
    units = _units(plan, one, nominal.robots)
    seed = int(plan.rng(one.key, "trials").integers(2**31))
    hidden: list[Effect] = []
    if limits is not None:
        trajectories = _trajectories(plan, seed, build_team(plan.payload, units))
        hidden.append(_drawn(plan, one, Ground.of(nominal, trajectories, limits), limits))
    places = [_place(effect) for effect in hidden]
    # A cause can act only once at a place, so the hidden effect replaces the tolerated one.
    tolerated = [e for e in _tolerated(plan, one, nominal.robots) if _place(e) not in places]
    done = simulate_trials(
        plan.payload, plan.kinds,
        vias=plan.vias, duration_s=plan.duration_s, preset=plan.preset, seed=seed,
        effects=[*hidden, *tolerated], units=units,
    )  # fmt: skip
    truth = {
        "effects": [_told(effect) for effect in hidden],
        "units": [unit.to_dict() for unit in units],
        "gimbal_axes_1": gimbal_axes(nominal),
        "control": [one.log.stability and one.log.stability.to_dict() for one in done],
    }
    return list(recordings_of(done)), truth


def _units(plan: CampaignPlan, one: CampaignSet, robots: int) -> Sequence[AsBuilt]:
    if one.background == "uncalibrated":
        return sensor_preset("uncalibrated").spread.draw(robots, plan.rng(one.clean.key, "units"))
    return plan.units if one.background == "units" else ()


def _tolerated(plan: CampaignPlan, one: CampaignSet, robots: int) -> list[Effect]:
    """Draw the tolerated deviations of a team, equal in all its sets; ``units`` already contain some of them."""
    drawn = cheaper(
        draw_background(robots, plan.rng(one.clean.key, "tolerances"), tolerances=plan.tolerances)
    )
    has = () if one.background == "calibrated" else SPREAD_IN_UNCALIBRATED
    return [effect for effect in drawn if effect.cause not in has]


def _trajectories(plan: CampaignPlan, seed: int, team: TeamScene) -> list[Trajectory]:
    """Make the same commands as ``simulate_trials``, to know the durations of the trials."""
    given = {"vias": plan.vias, "duration_s": plan.duration_s}
    told: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    return [
        make_trajectory(TrialRequest(plan.payload, kind, seed, plan.kinds[:k].count(kind), **told), team)
        for k, kind in enumerate(plan.kinds)
    ]


def _drawn(plan: CampaignPlan, one: CampaignSet, ground: Ground, limits: MeasuredLimits) -> Effect:
    assert one.cause is not None
    assert one.factor is not None
    places = limits.where(one.cause, [number for number, _, _ in ground.moving])
    if not places:
        raise InputError(f"{one.cause}: nothing in these recordings shows it, however large")
    rng = plan.rng(one.key, "effect")
    robot, joint = places[int(rng.integers(len(places)))]
    return draw_at(one.cause, one.factor, robot, joint, ground, rng)


def _place(effect: Effect) -> tuple[Any, ...]:
    return effect.cause, *(getattr(effect, name) for name in effect.place_names())


def _told(effect: Effect) -> dict[str, Any]:
    """Describe an effect together with the answer that counts as right, for ``summary.match``."""
    told = effect_to_dict(effect)
    answer = {name: told.get(name) for name in ("cause", "robot", "joint")} | {"known": told["parameters"]}
    return told | {"answer": answer}


@dataclass(frozen=True)
class Campaign:
    """Summary of a campaign.

    Attributes:
        values: summary with the keys that ``mocobot.campaign.summary`` documents.
        made_with: provenance.
    """

    values: Json
    made_with: Json

    def __str__(self) -> str:
        """Return the text report."""
        return format_campaign(self.values)

    def write(self, folder: Path, *, pictures: bool = True) -> str:
        """Write summary, table, report and provenance into the folder of the campaign, and list their names."""
        written = [folder / name for name in (SUMMARY, TABLE, REPORT)]
        write_json(written[0], self.values)
        write_text(written[1], csv_table(self.values))
        write_text(written[2], f"{self}\n")
        if pictures and draws_plots():
            from mocobot.plots import save_campaign  # imports matplotlib

            written += save_campaign(self.values, folder)
        write_json(folder / NAME, folder_provenance(self.made_with, folder, written))
        return f"{SUMMARY}, {TABLE}, {REPORT}, {NAME}, sets{' and plots' * pictures}"


def campaign(
    out: Path,
    options: CampaignOptions,
    *,
    force: bool = False,
    done: Callable[[int], object] = quiet,
) -> Campaign:
    """Hide effects in simulated teams, diagnose them blind and count the results; resumes an interrupted campaign.

    Args:
        out: folder of the campaign.
        options: options of the campaign.
        force: whether to delete the results of another campaign in the folder.
        done: called with the number of sets that were finished since the last call.

    Raises:
        InputError: an option is invalid, the folder holds another campaign, or an output cannot be written.
    """
    plan = CampaignPlan.of(options)
    made_with = provenance("campaign", options, inputs_of(options))
    store = CampaignStore(out, config_of(options), force=force)
    with workers_of(options.scheduler):
        results = run_campaign(plan, store, options.jobs, done, remote=options.scheduler is not None)
    return Campaign(summarise(results, plan.exclude), made_with)


def config_of(options: CampaignOptions) -> dict[str, str]:
    """Return the values that determine the results of sets, as text by name; the key of the code comes last."""
    values = {name: value for name, value in asdict(options).items() if name not in NO_MATTER}
    files = inputs_of(options)
    for name in FILES:
        given = values[name]
        of = [file for file in files if given is not None and Path(given) in (file, file.parent)]
        if of:
            values[name] = f"{of[0].name} (sha256 {file_facts(of[0])['sha256'][:12]})"
    return {name: _words(value) for name, value in values.items()} | {"code": run_key({})}


def _words(value: Any) -> str:
    if isinstance(value, Sequence) and not isinstance(value, str):
        return " ".join(map(_words, value)) or "none"
    return f"{value:g}" if isinstance(value, float) else str(value)


def run_campaign(
    plan: CampaignPlan,
    store: CampaignStore,
    jobs: int = 1,
    done: Callable[[int], object] = quiet,
    *,
    remote: bool = False,
    work: Callable[[tuple[CampaignPlan, CampaignSet, Json | None]], Json] | None = None,
) -> list[Json]:
    """Run all sets without a stored result; clean sets come first, because they provide the detection limits.

    Args:
        plan: plan of the campaign.
        store: store of the results.
        jobs: number of processes; results do not depend on it.
        done: called with the number of sets that were finished since the last call.
        remote: whether joblib's backend runs its processes on other machines.
        work: function that makes a result from (plan, set, limits); ``run_set`` if None.

    Returns:
        Results of all sets, clean ones first, in the order of the plan.

    Raises:
        InputError: a result cannot be read or written.
    """
    clean, hidden = plan.clean_sets(), plan.hidden_sets()
    _run([(plan, one, None) for one in clean], store, jobs, done, remote, work or run_set)
    limits = {one: store.get(one).get("limits") for one in clean}
    tasks = [(plan, one, limits[one.clean]) for one in hidden]
    _run(tasks, store, jobs, done, remote, work or run_set)
    return [store.get(one) for one in [*clean, *hidden]]


def _run(
    tasks: Sequence[tuple[CampaignPlan, CampaignSet, Json | None]],
    store: CampaignStore,
    jobs: int,
    done: Callable[[int], object],
    remote: bool,
    work: Callable[..., Json],
) -> None:
    todo = [task for task in tasks if not store.has(task[1])]
    done(len(tasks) - len(todo))
    pool = Parallel(
        n_jobs=jobs,
        return_as="generator_unordered",
        pre_dispatch="all" if remote else "2 * n_jobs",
        **ends_with_this(),
    )
    results: Any = pool(delayed(work)(task) for task in todo)
    for result in results:
        store.put(result)
        done(1)


def run_set(task: tuple[CampaignPlan, CampaignSet, Json | None]) -> Json:
    """Simulate and diagnose one set; the diagnosis does not see the truth.

    Errors become part of the result, so that one set cannot end the campaign.
    """
    plan, one, limits = task
    result: Json = {"set": one.to_dict(), "error": None, "unexpected": False}
    try:
        if one.cause is not None and limits is None:
            raise InputError(
                f"team {one.team} has no detection limits, since its clean set was not diagnosed"
            )
        known = None if limits is None else MeasuredLimits(limits["places"], limits["pushes"])
        recordings, truth = simulate_set(plan, one, known)
        found = _diagnosed(plan, recordings)
        result |= {"truth": truth, "verdict": {key: found.to_dict()[key] for key in KEPT}}
        if one.cause is None:
            result["limits"] = _limits(plan, found)
    except (InputError, TrialError) as error:
        result["error"] = str(error)
    except Exception:
        result |= {"error": traceback.format_exc(), "unexpected": True}
    return result


def _diagnosed(plan: CampaignPlan, recordings: Sequence[Recording]) -> TeamDiagnosed:
    robots = Robots(plan.calibration)
    found = diagnose_team(
        [robots.of(recording) for recording in recordings], plan.tolerances, plan.exclude,
        closed_loop=plan.closed_loop,
    )  # fmt: skip
    if not isinstance(found, TeamDiagnosed):
        raise InputError(
            "the diagnosis found a payload of two bodies; a campaign hides effects in rigid ones"
        )
    return found


def _limits(plan: CampaignPlan, found: TeamDiagnosed) -> Json:
    return {
        "places": found.to_dict()["detection_limits"],
        "pushes": [] if "push" in plan.exclude else push_limits(found.outcome, plan.tolerances["push"]),
    }
