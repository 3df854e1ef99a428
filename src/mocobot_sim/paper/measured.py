"""Tables II-V as measurements: chi-squares of the published means and scatters against those of a simulated column.

Means. A published mean m over n trials with standard deviation s has the standard error s / sqrt(n), and so has ours.
It also depends on how the robots of the team deviate, which nobody knows. Over teams of the uncalibrated preset a mean
varies by the standard deviation t (``simulated.toml``). Hence

    chi2 = sum (m - m')^2 / (s^2 / n + s'^2 / n' + u t^2),

with u = 2 if our robots are another draw of such a team, and u = 0 if they are as designed. The same three robots carry
all payloads, so the entries of a table are correlated. With the correlation matrix R of N entries over teams, chi2
behaves like N / nu times a chi-square of nu = N^2 / tr(R^2) degrees of freedom (Satterthwaite).

Scatter. For normal errors (n - 1) s^2 / sigma^2 is a chi-square of k = n - 1 degrees of freedom. Its logarithm has the
mean psi(k / 2) - ln(k / 2) and the variance psi'(k / 2), about 2 / k, with the digamma function psi. Hence

    chi2 = sum (ln(s^2 / s'^2) - bias)^2 / (psi'(k / 2) + psi'(k' / 2) + (h / s)^2 / 3),

where the last term is the variance of ln s^2 due to rounding to steps of h. Entries count as independent, so chi2 has
one degree of freedom for each entry with a scatter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import exp
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import digamma, polygamma
from scipy.stats import chi2

from estimator.strict import read_toml
from mocobot_sim.paper.scoring import MOMENTS, published_errors

ENTRIES = {
    "II": ("R12_deg", "R23_deg", "R31_deg"),
    "III": ("p12_m", "p23_m", "p31_m"),
    "IV": ("m_kg", "p1c_m"),
    "V": tuple(f"all.{name}" for name in MOMENTS),
}
"""Entries of each table by their path in the scores. Percentages repeat them."""
STEPS = {"R": 0.01, "p": 0.001, "m": 0.01, "a": 0.001}
"""Rounding steps of the published numbers by the first letter of the entry [deg, m, kg, kg m^2]."""
TRIALS = 6
"""Trials of each published mean; Table IV has one set of holds and no standard deviation."""


@dataclass(frozen=True)
class Agreement:
    """How a simulated column agrees with one published table."""

    table: str  # number of the table
    means: float  # chi-square of the means
    entries: int  # number of means
    freedom: float  # effective degrees of freedom of the means, at most ``entries``
    scatter: float | None = None  # chi-square of the scatters; None for a table or column without them
    scatters: int = 0  # number of scatters, which are the degrees of freedom
    ratio: float | None = None  # published over simulated standard deviation, geometric mean

    @property
    def means_p(self) -> float:
        """Probability of at least this chi-square of the means, if the simulated team is one like the paper's."""
        return float(chi2.sf(self.means * self.freedom / self.entries, self.freedom))

    @property
    def scatter_p(self) -> float | None:
        """Probability of at least this chi-square of the scatters, if both have the same variances."""
        return None if self.scatter is None else float(chi2.sf(self.scatter, self.scatters))


@cache
def simulated() -> dict[str, Any]:
    """Read ``simulated.toml``: scatter of the means over teams, and the effects of the laden column."""
    return read_toml(Path(__file__).with_name("simulated.toml"), "file of simulated teams")


def entry(errors: Mapping[str, Any], path: str) -> tuple[float | None, float | None]:
    """Mean and standard deviation (or None) of one entry of the scores of a payload."""
    value: Any = errors
    for key in path.split("."):
        value = value[key]
    return (value["mean"], value["std"]) if isinstance(value, Mapping) else (value, None)


def agreement(
    scores: Mapping[str, Mapping[str, Any] | None],
    trials: int,
    drawn: bool,
    teams: Mapping[str, Any] | None = None,
) -> list[Agreement]:
    """Compare one column with Tables II-V.

    Args:
        scores: scores of the column by payload, as ``score`` makes them.
        trials: random trials of each payload; as many random and periodic ones together make Table V.
        drawn: whether the robots are drawn from the uncalibrated preset; otherwise they are as designed.
        teams: for each table the effective degrees of freedom ``freedom`` and, by payload, the standard deviations of
            its entries over teams; None for those of ``simulated.toml``.
    """
    teams = simulated()["teams"] if teams is None else teams
    found = []
    for table, paths in ENTRIES.items():
        count = 2 * max(1, trials // 2) if table == "V" else trials
        pulls, logs, ratios = [], [], []
        for payload, errors in scores.items():
            for k, path in enumerate(paths if errors else ()):
                theirs, ours = entry(published_errors(payload), path), entry(errors or {}, path)
                if theirs[0] is None or ours[0] is None:
                    continue
                noise = (theirs[1] or 0.0) ** 2 / TRIALS + (ours[1] or 0.0) ** 2 / count
                noise += STEPS[path[0]] ** 2 / 12.0
                unlike = 2.0 * teams[table][payload][k] ** 2 if drawn else 0.0
                pulls.append((theirs[0] - ours[0]) ** 2 / (noise + unlike))
                if theirs[1] and ours[1]:
                    ratios.append(2.0 * np.log(theirs[1] / ours[1]))
                    logs.append(_log_ratio(ratios[-1], count, STEPS[path[0]] / theirs[1]))
        if pulls:
            freedom = min(teams[table]["freedom"], len(pulls)) if drawn else float(len(pulls))
            one = Agreement(table, float(sum(pulls)), len(pulls), freedom)
            if logs:
                ratio = exp(0.5 * float(np.mean(ratios)))
                one = replace(one, scatter=float(sum(logs)), scatters=len(logs), ratio=ratio)
            found.append(one)
    return found


def _log_ratio(log_ratio: float, trials: int, step: float) -> float:
    """Squared and standardised logarithm of a ratio of variances; ``step`` is the rounding over the published one."""
    k = np.array([TRIALS - 1.0, trials - 1.0]) / 2.0
    bias = np.diff(digamma(k) - np.log(k))[0]
    return float((log_ratio + bias) ** 2 / (polygamma(1, k).sum() + step**2 / 3.0))


def effective_freedom(teams: np.ndarray) -> float:
    """Degrees of freedom N^2 / tr(R^2) of N correlated entries, from K teams, shape (K, N).

    The square of a correlation coefficient of K independent pairs has the mean 1 / (K - 1), which is subtracted.
    """
    count, entries = teams.shape
    squares = np.corrcoef(teams.T) ** 2
    off = max(0.0, float(squares.sum()) - entries - entries * (entries - 1) / (count - 1))
    return entries**2 / (entries + off)


def format_agreement(columns: Mapping[str, Sequence[Agreement]]) -> str:
    """Format the agreement of several columns as text, one line for each table."""
    heads = [
        "table",
        "column",
        "chi2 of means",
        "dof",
        "p",
        "chi2 of scatter",
        "dof",
        "p",
        "scatter, paper over ours",
    ]
    rows = [heads] + [
        [
            one.table, name, f"{one.means:.3g}", f"{one.entries} ({one.freedom:.1f})", f"{one.means_p:.2g}",
            *(["none"] * 4 if one.scatter is None or one.ratio is None or one.scatter_p is None else
              [f"{one.scatter:.3g}", str(one.scatters), f"{one.scatter_p:.2g}", f"{one.ratio:.3g}"]),
        ]
        for k in range(len(ENTRIES))
        for name, every in columns.items()
        for one in every[k : k + 1]
    ]  # fmt: skip
    widths = [max(len(row[k]) for row in rows) for k in range(len(heads))]
    lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join(["The tables as measurements", "", lines[0], "-" * max(map(len, lines)), *lines[1:]])
