"""Constants of the search."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Constants of the search and of the noise model.

    Attributes:
        floor_rows: pseudo-observations behind the noise floor (20: a band of 0.25 Hz in 40 s).
        spread_rows: pseudo-observations behind the nominal spread of a family of random effects.
        least_spread: lower limit of the learnt variance factor of random effects.
        most_spread: upper limit of the variance factor of a law's errors (1: a tenth of its trace).
        form_share: standard deviation of a law's error in each of its forms, relative to the law's trace.
        need_nats: log odds by which a set must exceed another to replace it (1: a factor of e).
        cause_nats: prior log odds against any one cause, in addition to the log of the number of causes.
        open_nats: log odds over nothing that the errors of other causes' laws can take up if a cause is removed.
            Fitted by log score to arms whose effects follow other laws than the table: 9 to 14 score alike.
        unlisted_share: the same for events and unlisted laws beside other unlisted laws, as a share of the log evidence
            of these laws. Chosen when false pushes and laws beside two hidden laws were worth 1 to 52 % of them.
        most_causes: largest set.
        tried: candidates with exact evidence in each step, selected by linear gain.
        tried_quiet: additional candidates, selected by linear gain with the noise at its floor.
        octaves: number of prior scales for a cause; each is half the one before, starting from the slab.
        noise_steps: learning steps of noise and spreads for a candidate.
        settle_steps: largest number of repetitions for an accepted set.
        start_steps: learning steps without a nearby posterior to start from.
        floor_steps: largest number of iterations for the noise floor.
        floor_change: relative change of the floor's variances below which the iteration has converged.
        rounds: number of repeated linearisations.
        event_steps: number of refinements of an event's interval.
        apart: standard errors, or learnt tolerances, beyond which a member of a kind is an outlier.
        within_nats: linear gain below that of a cause beyond which an alternative is ignored (15: 3e-7 of its odds).
        most_rivals: alternatives with exact evidence.
        named: least probability that something is there, for a cause to be named.
        scatter: deviation of a kind in tolerances (root mean square) beyond which a machine is miscalibrated.
        noticed: standard errors beyond the threshold for a detection probability of 90 %: the normal quantile.
        plain: factor on prior standard deviations for reported values, so that the prior does not shrink them.
        clean_chi2: squared residuals over the floor's variance, per row, up to which the residual counts as noise.
        least_floor: least noise variance over the power of the quietest band, if the sensor noise is unknown.
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
"""Prior odds of any one cause. Derived: exp(-``cause_nats``)."""
