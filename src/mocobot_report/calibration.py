"""Report of a calibration: trustworthiness, robots, payloads, recordings and open questions."""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from markupsafe import Markup

from estimator.arm.unit import AT
from estimator.calibrate.calibration import Calibration, carried, grasps_of
from estimator.calibrate.text import DEG, MASSES, SHOWN, alike, frames_sentence, shown_groups
from mocobot_report.charts import Axis, Chart, Key, axis, bars, dots, log_axis, row_layout
from mocobot_report.numbers import NONE, counted, kinds_of, percent, plain, short_names, with_error
from mocobot_report.tables import Entry, Num, measurement, table, vector

if TYPE_CHECKING:
    from mocobot_report.folder import Result

FITS = (
    Key("before", "as designed", "before", "circle"),
    Key("after", "calibrated", "after", "square"),
    Key("held_out", "left out", "c1", "diamond"),
)
"""Legend of a recording's fits; the group of each entry is an attribute of ``CalibratedTrial``."""
NOISE = Key("", "noise alone", "text", "dash")
ASSUMED = Key("", "as assumed beforehand", "text", "dash")
COLOURS = ("r1", "r2", "r3", "r4", "r5", "r6")
APART = 0.2


def context(result: "Result", say: Callable[[str], object]) -> dict[str, Any]:
    """Return the data of ``assets/calibration.html``."""
    say("calibration")
    c: Calibration = result.found
    return {
        "title": f"Calibration of {c.robots} robots from {counted(len(c.trials), 'recording')}",
        "c": c,
        "kinds": kinds_of([trial.kind for trial in c.trials]),
        "seconds": f"{sum(trial.duration_s for trial in c.trials):.0f}",
        "frames": frames_sentence(c),
        "tiles": _tiles(c),
        "deviations": _deviation_chart(c),
        "certainty": _certainty_chart(c),
        "robots": [(f"Robot {k + 1}", shown) for k, shown in enumerate(deviation_tables(c))],
        "payloads": payload_table(c),
        "fits": _fit_charts(c),
        "recordings": trial_table(c),
        "shares": _share_chart(c),
        "pictures": [],
    }


def _tiles(c: Calibration) -> list[tuple[str, str, str]]:
    out = []
    for payload in c.payloads:
        found = carried(payload, c.scale_sd)
        label = "" if payload.label is None else f" of payload ({payload.label})"
        out.append((f"mass{label}", with_error(found.mass_kg, found.mass_se_kg, "kg"), ""))
    for key in FITS:
        pairs = [getattr(trial, key.group) for trial in c.trials if trial.payload is not None]
        pairs = [pair for pair in pairs if pair is not None]
        means = [plain(float(np.mean([pair[k] for pair in pairs])), 3) for k in range(2)] if pairs else [NONE]
        out.append((f"chi²/n {key.label}", " / ".join(means), "loops / balance, mean of recordings"))
    return out


def deviation_tables(calibration: Calibration) -> list[Markup]:
    """Make one table of deviations per robot, with legs or axes side by side and the prior standard deviations."""
    out = []
    for robot in range(calibration.robots):
        rows: list[list[Entry]] = []
        for group in shown_groups(calibration):
            shown, at = SHOWN[group.name], AT[group.name]
            entries = zip(calibration.units.x[robot, at], calibration.sd[robot, at], strict=True)
            cells: list[Entry] = [
                measurement(shown.scale * value, shown.scale * se) if se > 0 else Num("held")
                for value, se in entries
            ]
            prior = plain(shown.scale * float(np.max(calibration.prior_sd[robot, at])), 2)
            rows.append([shown.name, shown.unit, *cells, *[""] * (3 - len(cells)), Num(prior)])
        if alike(calibration):
            at = AT[MASSES[0]].start
            cell = measurement(100.0 * calibration.units.x[robot, at], 100.0 * calibration.sd[robot, at])
            prior = plain(100.0 * float(calibration.prior_sd[robot, at]), 2)
            rows.append(["mass of all arms together", "%", cell, "", "", Num(prior)])
        out.append(
            table(
                f"Robot {robot + 1}", ["", "unit", "leg 1, or z", "leg 2, or y", "leg 3, or x", "assumed ±"], rows,
                note="± standard error; lengths, springs and masses: as built minus design; zeros: reading minus "
                "truth; tilt: about x and y",
            )
        )  # fmt: skip
    return out


def payload_table(calibration: Calibration) -> Markup:
    """Tabulate mass, centre of mass, principal moments and grasps of every payload."""
    found = [carried(payload, calibration.scale_sd) for payload in calibration.payloads]
    rows: list[list[Entry]] = [["mass", "kg", *(measurement(f.mass_kg, f.mass_se_kg) for f in found)]]
    rows += vector("p_1c", "mm", [(f.p_1c, f.p_1c_se_m) for f in found], 1e3)
    moments = [(f.principal.moments, f.principal.moments_se) for f in found]
    rows += vector("principal moment", "kg m²", moments, parts="123")
    for j in range(2, calibration.robots + 1):
        pairs = [grasps_of(payload, calibration.scale_sd).pair(1, j) for payload in calibration.payloads]
        rows += vector(f"p_1{j}", "mm", [(pair.p_ij, pair.p_se_m) for pair in pairs], 1e3)
        rows += vector(
            f"R_1{j}", "deg", [(pair.axis_angle_rad, pair.axis_angle_se_rad) for pair in pairs], DEG
        )
    names = ["value" if p.label is None else f"payload ({p.label})" for p in calibration.payloads]
    note = "± standard error; p_1c: centre of mass in {1}; p_12, R_12: place, rotation vector of {2} in {1}"
    return table("What was carried", ["", "unit", *names], rows, note=note)


def trial_table(calibration: Calibration) -> Markup:
    """Tabulate chi²/n of loops and balance of every recording: as designed, calibrated, and left out of the fit."""
    names = short_names([trial.name for trial in calibration.trials])
    rows: list[list[Entry]] = []
    for name, trial in zip(names, calibration.trials, strict=True):
        cells = [
            Num(NONE if pair is None or not trial.count[k] else plain(pair[k], 3))
            for k in range(2)
            for pair in (trial.before, trial.after, trial.held_out)
        ]
        rows.append([name, trial.kind, Num(f"{trial.duration_s:.1f}"), *cells])
    stages = ("designed", "calibrated", "left out")
    fits = [f"{kind}: {stage}" for kind in ("loops", "balance") for stage in stages]
    note = "chi²/n; 1 is noise alone; left out: predicted by a calibration from all other recordings"
    return table("Recordings", ["recording", "trial", "length [s]", *fits], rows, note=note)


class Deviation(NamedTuple):
    """One estimated deviation of a robot, with its row in a chart."""

    row: int
    name: str
    unit: str
    scale: float
    value: float
    se: float
    prior: float


def _deviations(calibration: Calibration, robot: int) -> Iterator[Deviation]:
    for row, group in enumerate(shown_groups(calibration)):
        shown, at = SHOWN[group.name], AT[group.name]
        columns = (calibration.units.x[robot, at], calibration.sd[robot, at], calibration.prior_sd[robot, at])
        for entry, value, se, prior in zip(group.entries, *columns, strict=True):
            if se > 0:
                # Zeros of theta_x have no prior in the fit; with parallel flanges, use that of the other encoders.
                known = float(prior) or calibration.prior.encoder_zero_rad
                name, numbers = f"{shown.name} {entry}", (float(value), float(se), known)
                yield Deviation(row, name, shown.unit, shown.scale, *numbers)


Of = Callable[[Deviation], tuple[float, float, str]]


def _of_robots(c: Calibration, words: Sequence[str], across: Axis, rules: Sequence[float], of: Of) -> Chart:
    """Plot one row per kind of deviation with a dot per deviation; ``of`` returns x, half a bar and a text."""
    names, data = kind_names([group.name for group in shown_groups(c)]), []
    keys = [Key(f"r{k + 1}", f"robot {k + 1}", COLOURS[k % len(COLOURS)], "circle") for k in range(c.robots)]
    for robot, key in enumerate(keys):
        found = list(_deviations(c, robot))
        aside = APART * (robot - 0.5 * (c.robots - 1)) * min(1.0, 3.0 / c.robots)
        x, half, said = zip(*map(of, found), strict=True) if found else ((), (), ())
        text = [f"{key.label}, {d.name}: {words}" for d, words in zip(found, said, strict=True)]
        data.append(dots(x, [d.row + aside for d in found], key, text, size=7))
        if any(half):
            data[-1]["error_x"] = {"array": list(half), "thickness": 1.3, "width": 3}
    layout = row_layout(names, across, rules=rules, row_px=50, left_px=178, most=30)
    title, label, note = words
    return Chart(title, label, data, keys=[*keys, ASSUMED], note=note, **layout)


def _deviation_chart(c: Calibration) -> Chart:
    """Plot every deviation in prior standard deviations, with bars of two standard errors."""
    every = [d.value / d.prior for robot in range(c.robots) for d in _deviations(c, robot)]
    most = 1.08 * max([2.0, *map(abs, every)])
    across = axis("deviation over prior sd", range=[-most, most], zerolinewidth=1.5)
    label = "Every deviation of every robot in prior standard deviations, grouped by kind; values are in the tables."
    words = ("How far the robots are off", label, "bars: two standard errors either way")
    return _of_robots(
        c, words, across, (-1.0, 1.0),
        lambda d: (d.value / d.prior, 2.0 * d.se / d.prior, with_error(d.scale * d.value, d.scale * d.se, d.unit)),
    )  # fmt: skip


def _certainty_chart(c: Calibration) -> Chart:
    """Plot standard errors over prior standard deviations."""
    every = [d.se / d.prior for robot in range(c.robots) for d in _deviations(c, robot)]
    across = log_axis("standard error over prior sd", [1.0, *every])
    label = "Standard error of every deviation over its prior standard deviation; at 1 the data said nothing."
    words = ("How much better they are known than before", label, "at 1 the recordings said nothing")
    return _of_robots(
        c, words, across, (1.0,),
        lambda d: (d.se / d.prior, 0.0, f"from {plain(d.scale * d.prior, 2)} to {plain(d.scale * d.se, 2)} {d.unit}"),
    )  # fmt: skip


def fits_of(calibration: Calibration, kind: int, key: Key) -> list[tuple[int, float]]:
    """Return index and chi²/n of every recording with loop rows (kind 0) or balance rows (kind 1), for one fit."""
    pairs = [getattr(trial, key.group) if trial.count[kind] else None for trial in calibration.trials]
    return [(k, pair[kind]) for k, pair in enumerate(pairs) if pair is not None]


def _fit_charts(calibration: Calibration) -> list[Chart]:
    """Plot chi²/n of every recording, for loops and for balance."""
    short = short_names([trial.name for trial in calibration.trials])
    charts = []
    titles = ("Loops: where robots have each other's grasps", "Balance: wrenches and motion")
    for kind, title in enumerate(titles):
        there = [k for k, trial in enumerate(calibration.trials) if trial.count[kind]]
        names = [short[k] for k in there]
        data, seen = [], [1.0]
        for key in FITS:
            found = [(number, there.index(k)) for k, number in fits_of(calibration, kind, key)]
            text = [f"{names[row]}, {key.label}: {plain(number)}" for number, row in found]
            data.append(dots([number for number, _ in found], [row for _, row in found], key, text))
            seen += [number for number, _ in found]
        label = f"{title}: chi-square per number of every recording as designed, calibrated and left out."
        layout = row_layout(names, log_axis("chi²/n", seen), rules=[1.0], row_px=34, most=20)
        charts.append(Chart(title, label, data, keys=[*FITS, NOISE], **layout))
    return charts


def _share_chart(calibration: Calibration) -> Chart | None:
    """Plot the share of every recording in the information on each kind of parameter."""
    kinds, series = shares_of(calibration)
    if not series:
        return None
    left = [max(0.0, 1.0 - sum(shares)) for shares in zip(*(shares for _, shares in series), strict=True)]
    colours = [COLOURS[k % len(COLOURS)] for k in range(len(series))]
    series = [*series, ("prior and weights", left)]
    keys = [
        Key(f"s{k}", name, colour, "band")
        for k, ((name, _), colour) in enumerate(zip(series, [*colours, "band"], strict=True))
    ]
    data = [
        bars(shares, key, [f"{name}: {percent(share)}" for share in shares], 0.66, textposition="none")
        for key, (name, shares) in zip(keys, series, strict=True)
    ]
    across = axis("share [%]", range=[0, 100], nticks=6)
    return Chart(
        "What each recording contributes",
        "Share of every recording in what is known of each kind of parameter; the rest is the prior's.",
        data, keys=keys, note="share of the information, averaged over the parameters of a kind",
        **row_layout(kind_names(kinds), across, row_px=34, left_px=190, most=32),
    )  # fmt: skip


def shares_of(calibration: Calibration) -> tuple[list[str], list[tuple[str, list[float]]]]:
    """Return the kinds of parameters, and every recording's name with its share of the information on each kind."""
    trials = [trial for trial in calibration.trials if trial.shares]
    # Hide the masses that ``shown_groups`` omits: with equal arms, only one of them is independent.
    shown = {group.name for group in shown_groups(calibration)}
    hidden = {*MASSES, "tilt"} - shown
    kinds = [kind for kind in (trials[0].shares if trials else {}) if kind not in hidden]
    names = short_names([trial.name for trial in trials])
    shares = [[trial.shares.get(kind, 0.0) for kind in kinds] for trial in trials]
    return kinds, list(zip(names, shares, strict=True))


def kind_names(kinds: list[str]) -> list[str]:
    """Return the names of kinds of parameters in words."""
    from estimator.calibrate.calibration import GRASPS, INERTIAL

    names = {GRASPS: "grasps", INERTIAL: "mass, centre of mass, inertia"}
    return [names.get(kind) or SHOWN[kind].name for kind in kinds]
