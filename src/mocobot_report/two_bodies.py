"""Report of an estimate of two bodies: the joint, both bodies, the evidence, and the joint's position over time."""

import contextlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from estimator.arrays import Array, inertia_parameters
from estimator.errors import InputError
from estimator.estimate.inertia import PARAMETERS
from estimator.strict import read_json
from estimator.two_bodies.result import ABOUT_AXIS, UNITS, TwoBodies
from mocobot_report.charts import Key, Line, Panel, points_of_each, stacked_chart, thinned
from mocobot_report.folder import Result, Source, sources
from mocobot_report.numbers import counted, kinds_of, plain, spelled, with_error
from mocobot_report.tables import Entry, Num, measurement, quantity, value
from mocobot_sim.scene.models import truth_path
from mocobot_view.replay_trial import replay_trial

ESTIMATED, TRUE, GAPS = (
    Key("joint", "estimated", "c1"),
    Key("truth", "truth", "text"),
    Key("gap", "rms", "c2"),
)
HEAD = ("", "unit", "value ± standard error")
Rows = list[list[Entry]]


def context(result: Result, say: Callable[[str], object]) -> dict[str, Any]:
    """Return the data of ``assets/two-bodies.html``."""
    e: TwoBodies = result.found
    say(f"estimate {result.path.name}")
    found = sources(result)
    truth, truth_name = _truth(found)
    name = "Payload" if e.payload is None else f"Payload ({e.payload})"
    return {
        "title": f"{name} of two bodies, estimated from {counted(len(e.recordings), 'recording')}",
        "e": e, "kinds": kinds_of([r.trial for r in e.recordings]), "division": divided(e.halves), "tiles": _tiles(e),
        "head": (*HEAD, "truth") if truth else HEAD, "truth_name": truth_name, "tables": _tables(e, truth),
        "bodies": [[f"held by {' '.join(map(str, half))}", value(one.mass, 4), _vector(1e3 * one.com),
                    _vector(np.diag(one.inertia))] for half, one in zip(e.halves, (e.bodies or ())[:2], strict=False)],
        "range": None if e.bodies is None else [plain(m, 2) for m in e.bodies[2]],
        "explained": [[one.motion, divided(one.halves), value(one.log_evidence - e.explained[0].log_evidence, 3),
                       value(one.noise, 3)] for one in e.explained],
        "recordings": [[r.name, r.trial, Num(f"{r.duration_s:.1f}"), value(r.loops_chi2_n, 3),
                        value(r.balance_chi2_n, 3)] for r in e.recordings],
        "weak": [str(weak) for weak in e.undetermined],
        "motion": _motion(found, e, say), "pictures": [],
    }  # fmt: skip


def divided(halves: Sequence[Sequence[int]]) -> str:
    """Write who holds which body."""
    return " | ".join(" ".join(map(str, half)) for half in halves)


def _truth(found: Sequence[Source]) -> tuple[dict[str, Any] | None, str]:
    """Read the truth of two bodies beside the first recording that has one; also return the recording's name."""
    for source in found:
        with contextlib.suppress(InputError):
            if source.path is not None and (path := truth_path(source.path)).is_file():
                truth = read_json(path, "the truth beside a simulated recording")
                if truth.get("bodies"):
                    return truth, source.name
    return None, ""


def _vector(values: Array, digits: int = 4) -> str:
    return f"({', '.join(plain(float(v), digits) for v in values)})"


def _tiles(e: TwoBodies) -> list[tuple[str, str, str]]:
    whole, se = e.whole
    kind = f"{e.motion}, with a spring" if e.kind == "flexible" else e.kind
    size = f"{1e3 * e.q_rms:.3g} mm" if e.motion == "sliding" else f"{np.rad2deg(e.q_rms):.3g} deg"
    tiles = [
        ("joint", kind, f"robots {divided(e.halves)}; it moves by {size} (rms)"),
        ("axis in {1}", _vector(e.axes[:, 0]), f"± {plain(float(np.rad2deg(e.axis_se_rad)), 2)} deg"),
    ]
    if e.pivot is not None and e.pivot_se_m is not None:
        tiles.append(("through", f"{_vector(1e3 * e.pivot)} mm", f"± {plain(1e3 * e.pivot_se_m, 2)} mm"))
    return [*tiles, ("mass of both", with_error(whole.mass, float(se[0]), "kg"), "")]


def _tables(e: TwoBodies, truth: dict[str, Any] | None) -> tuple[Rows, Rows, Rows]:
    """Rows of the joint's terms, of both bodies together, and of the second body, with the truth if there is one."""
    true = None if truth is None else e.true_parameters(truth)

    def row(name: str, unit: str, found: float, se: float, known: float | None) -> list[Entry]:
        cells: list[Entry] = [quantity(name), spelled(unit), measurement(found, se)]
        return cells if true is None else [*cells, value(known, 5)]

    def told(name: str, key: str, unit: str) -> list[Entry]:
        k = e.names.index(key)
        return row(name, unit, *e.value(key), None if true is None else float(true[k]))

    whole, se = e.whole
    known = [None] * 10 if true is None else e.whole_of(true).tolist()
    names = ["mass", "p_1c x", "p_1c y", "p_1c z", *(f"I_{name.removeprefix('I')}" for name in PARAMETERS)]
    numbers = [whole.mass, *whole.com, *inertia_parameters(whole.inertia)]
    units = ["kg"] + ["m"] * 3 + ["kg m^2"] * 6
    both = [row(*each) for each in zip(names, units, numbers, se.tolist(), known, strict=True)]
    terms = [told(term, term, UNITS[e.motion][term]) for term in e.law]
    second = [told(name, key, unit) for key, (name, unit) in ABOUT_AXIS[e.motion].items()]
    return terms, both, second


def _motion(found: Sequence[Source], e: TwoBodies, say: Callable[[str], object]) -> dict[str, Any]:
    """Chart the joint and the gaps at the grasps of every recording that still exists; list what is missing."""
    charts, names, missing = [], [], []
    for source in found:
        say(f"motion of {source.name}")
        try:
            recording = source.recording()
            trial = replay_trial(recording, source.name, e)
        except InputError as error:
            missing.append(f"{error}.")
            continue
        if trial.two is None:
            continue
        truth, _ = _truth([source])
        most, slides = points_of_each(len(found)), e.motion == "sliding"
        scale, unit = (1e3, "mm") if slides else (180.0 / np.pi, "deg")
        lines = [Line(ESTIMATED, *_one(trial.time, scale * trial.two.q, most))]
        keys = [ESTIMATED]
        true = None if truth is None else e.true_position(truth)
        if true is not None and len(true) == len(trial.time):
            lines.insert(0, Line(TRUE, *_one(trial.time, scale * true, most), width=2.6))
            keys.append(TRUE)
        gap = 1e3 * np.sqrt(np.mean(trial.two.first.gap_position_m**2, axis=1))
        panels = [
            Panel("joint", unit, lines),
            Panel("grasps apart", "mm", [Line(GAPS, *_one(trial.time, gap, most))]),
        ]
        title = "Position of the joint, and distance between flanges and grasps"
        label = f"{title}, over time, {source.name}."
        charts.append(stacked_chart(title, label, panels, keys=[*keys, GAPS]))
        names.append(source.name)
    return {"charts": charts, "names": names, "missing": missing}


def _one(time: Array, values: Array, most: int) -> tuple[Array, Array]:
    time, values = thinned(time, values[:, None], most=most)
    return time, values[:, 0]
