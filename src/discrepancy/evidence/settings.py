"""Every number of the engine that decides."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Numbers of the search and of the noise.

    Attributes:
        floor_rows: observations that the noise's floor counts (20: a band of 0.25 Hz in 40 s).
        spread_rows: observations that the nominal spread of a family of random effects counts.
        least_spread: least learnt variance of random effects over their nominal one.
        most_spread: most of a law's errors (1: a tenth of its trace).
        form_share: standard deviation of a law's error, of the law's own trace, in each of its forms.
        need_nats: log odds by which a set must be likelier to replace another (1: a factor of e).
        cause_nats: log odds against any one cause before the data are seen, beside the number of causes.
        open_nats: log odds over nothing of what the laws of other causes leave where one is taken out. Fitted by log
            score to arms with effects whose laws are not the table's: 9 to 14 score alike.
        unlisted_share: the same of events and unlisted laws beside other unlisted laws, of what these explain.
        most_causes: largest set.
        tried: candidates whose exact evidence is computed in each step, the likeliest by the linear one.
        tried_quiet: the same of those that are likeliest with the noise at its floor.
        octaves: scales of a cause's prior, by halves from the slab down.
        noise_steps: steps in which noise and spreads are learnt for a candidate.
        settle_steps: times that is repeated at most for a set that is taken.
        start_steps: the same where nothing was learnt before.
        floor_steps: the same for the noise that the whole dictionary leaves.
        floor_change: relative change of its variances below which that has settled.
        rounds: times the problem is made linear again.
        event_steps: times the instants of an event are moved.
        apart: standard errors, or learnt tolerances, from which one of a kind stands out.
        within_nats: linear gain below that of a cause beyond which a rival is not weighed (15: 3e-7 of its odds).
        most_rivals: rivals that are weighed exactly.
        named: least probability of the told set of a cause that is named.
        scatter: tolerances (root mean square over a kind) from which a machine is miscalibrated.
        noticed: standard errors beyond the threshold at which nine in ten are noticed: the normal quantile of 90 %.
        plain: values are fitted with so many times their prior standard deviation, so that it shrinks nothing.
        clean_chi2: squares left over the floor's variance, per row, up to which nothing is left to explain.
        least_floor: least noise variance over the power of the quietest band, where the sensors' noise is not known.
    """

    floor_rows: float = 20.0
    spread_rows: float = 8.0
    least_spread: float = 1e-6
    most_spread: float = 1.0
    form_share: float = 0.1
    need_nats: float = 1.0
    cause_nats: float = 3.0
    open_nats: float = 10.0
    unlisted_share: float = 0.5
    most_causes: int = 30
    tried: int = 6
    tried_quiet: int = 3
    octaves: int = 5
    noise_steps: int = 2
    settle_steps: int = 8
    start_steps: int = 8
    floor_steps: int = 40
    floor_change: float = 0.05
    rounds: int = 3
    event_steps: int = 4
    apart: float = 3.0
    within_nats: float = 15.0
    most_rivals: int = 8
    named: float = 0.5
    scatter: float = 3.0
    noticed: float = 1.28
    plain: float = 3.0
    clean_chi2: float = 1.5
    least_floor: float = 1e-3


SETTINGS = Settings()
ODDS = 0.05
"""Odds of any cause being there before the data are seen. Derived: exp(-``cause_nats``)."""
