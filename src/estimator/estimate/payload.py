"""Pipeline from recordings of one payload to its estimate."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Literal

import numpy as np

from estimator.arm.unit import ArmUnit
from estimator.errors import InputError
from estimator.estimate.consistency import (
    Trial,
    balance_flags,
    check_agreement,
    check_disagreement_is_noise,
    check_rigid,
    check_same_payload,
    withheld,
    wrench_balance,
)
from estimator.estimate.grasps import GraspEstimate, estimate_grasps
from estimator.estimate.inertia import InertiaEstimate, estimate_inertia
from estimator.estimate.joint import estimate_joint
from estimator.estimate.leftover import contradiction, left_over, steps_of
from estimator.estimate.result import PayloadEstimate, RecordingEstimate
from estimator.estimate.statics import (
    CONTRADICTION,
    ComEstimate,
    MassEstimate,
    estimate_from_holds,
    rounding_kg,
)
from estimator.estimate.uncertainty import StepReport
from estimator.filtering import trim_slice
from estimator.quantisation import doubtful, without_held
from estimator.recording.checks import check_carries
from estimator.recording.model import Recording
from estimator.signals import GraspData, Hold, find_holds, process_recording

MASS_TOLERANCE = 0.05
"""Relative mass difference above which recordings are of different payloads, if it also exceeds ``MASS_SIGMAS``.
Chosen: no calibration error explains more."""
MASS_SIGMAS = 6.0
"""Limit of the same difference, in sums of both standard errors. Chosen."""


def mass_alone(data: GraspData, holds: Sequence[Hold], grasps: GraspEstimate | None) -> MassEstimate | None:
    """Estimate the mass from one recording with its holds and grasps; None if undetermined."""
    try:
        mass, com, _ = estimate_from_holds(holds, grasps, data.gravity_mps2)
        if com is None and grasps is not None:
            return estimate_joint([data], grasps)[0].mass
    except (InputError, FloatingPointError, np.linalg.LinAlgError):
        return None
    return mass


def check_one_payload(masses: Iterable[tuple[str, MassEstimate | None]]) -> None:
    """Compare the masses of recordings, given with their names.

    Raises:
        InputError: two masses differ by more than their errors and any calibration error.
    """
    found = [(mass.mass, mass.se, name) for name, mass in masses if mass is not None]
    if not found:
        return
    (low, low_se, light), (high, high_se, heavy) = min(found), max(found)
    if high - low > max(MASS_TOLERANCE * high, MASS_SIGMAS * (low_se + high_se)):
        raise InputError(
            f"{light} says {low:.2f} kg and {heavy} says {high:.2f} kg; recordings must be of one payload"
        )


Method = Literal["auto", "staged", "joint"]

TRIM_S = 2.0
"""Time dropped at both ends of each recording [s]."""
RESTING = 0.5
"""Share of rest above which a recording does not contribute to the inertia, if another one can."""


def estimate_payload(
    recordings: Iterable[Recording],
    method: Method = "auto",
    cutoff_hz: float = 5.0,
    say: Callable[[str], object] = lambda _: None,
    *,
    compare_masses: bool = False,
    withhold: bool = True,
) -> PayloadEstimate:
    """Estimate grasps, mass, centre of mass and inertia from recordings of one payload.

    Args:
        recordings: one or several trials with the same robots and grasps. They are consumed one at a time, so an
            iterator saves memory.
        method: ``"staged"``, the paper's sequence (grasps from motion; mass and centre of mass from static holds;
            inertia from motion); ``"joint"``, one least squares for mass, centre of mass and inertia; ``"auto"``,
            staged if the holds determine the centre of mass, else joint.
        cutoff_hz: cut-off of the low-pass filter [Hz].
        say: callback for the name of each stage.
        compare_masses: also refuse recordings with different individual masses (see ``check_one_payload``).
        withhold: omit results that the force balance contradicts (see ``withheld``).

    Raises:
        InputError: the recordings do not belong together or contradict each other, lack what the method needs,
            determine nothing, or lead to numerical overflow.
    """
    trials: list[Trial] = []
    names: list[str] = []
    with within_arithmetic(names):
        for recording in recordings:
            names.append(recording.name)
            trials.append(trial_of(recording, cutoff_hz))
            del recording  # free its memory before reading the next one
        return estimate_from_trials(trials, method, say, compare_masses=compare_masses, withhold=withhold)


@contextmanager
def within_arithmetic(names: Sequence[str]) -> Iterator[None]:
    """Convert numerical errors inside the block to an ``InputError``; ``names`` may be filled inside the block.

    Raises:
        InputError: an overflow, a division by zero, or a singular matrix occurs.
    """
    try:
        with np.errstate(over="raise", divide="raise"):
            yield
    except (FloatingPointError, np.linalg.LinAlgError) as error:
        raise InputError(
            f"{', '.join(names)}: the equations cannot be solved ({error}); are the numbers in 'design' plausible?"
        ) from error


def trial_of(recording: Recording, cutoff_hz: float = 5.0) -> Trial:
    """Process a recording for ``estimate_from_trials``; arguments and errors as for ``estimate_payload``."""
    check_carries(recording, "estimated")
    labels, steps = recording.metadata, steps_of(recording, cutoff_hz) if recording.base is None else None
    recording, held, doubt = without_held(recording)
    data = process_recording(recording, cutoff_hz, TRIM_S)
    if held:
        left_out = doubtful(doubt, labels.rate_hz, cutoff_hz)[trim_slice(len(doubt), labels.rate_hz, TRIM_S)]
        data = data.at(~left_out)
    return Trial(recording.name, labels.trial, labels.payload, data, steps, labels.team, labels.units)


def estimate_from_trials(
    trials: Sequence[Trial],
    method: Method = "auto",
    say: Callable[[str], object] = lambda _: None,
    *,
    compare_masses: bool = False,
    withhold: bool = True,
) -> PayloadEstimate:
    """Estimate the payload from processed data; see ``estimate_payload``."""
    if method not in ("auto", "staged", "joint"):
        raise InputError(f"method is {method!r}; it must be 'auto', 'staged' or 'joint'")
    payload = check_same_payload(trials)
    names = _distinct([trial.name for trial in trials])
    trials = [replace(trial, name=name) for trial, name in zip(trials, names, strict=True)]
    say("static holds")
    holds = [_holds(trial) for trial in trials]
    records = [
        RecordingEstimate(t.name, t.kind, t.data.samples / t.data.rate_hz, len(h))
        for t, h in zip(trials, holds, strict=True)
    ]
    flags: list[str] = []
    say("grasps")
    grasps, steps = _grasps(trials, records, flags)
    if grasps is not None:
        for k, trial in enumerate(trials):
            if trial.steps is not None:
                records[k] = replace(records[k], leftovers=left_over(trial.data, grasps, trial.steps))
    contradicts = contradiction([(record.name, record.leftovers) for record in records])
    flags += [contradicts] if contradicts else []

    say("mass and centre of mass")
    every_hold = [hold for found in holds for hold in found]
    mass, com, com_step = estimate_from_holds(every_hold, grasps, trials[0].data.gravity_mps2)
    if method == "staged" and not every_hold:
        raise InputError(
            "method 'staged' needs static holds and the recordings have none; use 'joint' or 'auto'"
        )
    if method == "auto":
        method = "joint" if com is None and grasps is not None else "staged"
    inertia: InertiaEstimate | None = None
    if method == "joint":
        if grasps is None:
            raise InputError(f"nothing can be estimated jointly: {_why(steps)}")
        say("mass, centre of mass and inertia")
        joint, joint_steps = estimate_joint([trial.data for trial in trials], grasps)
        least = rounding_kg(every_hold, trials[0].data.gravity_mps2)
        mass, com, inertia = replace(joint.mass, se=max(joint.mass.se, least)), joint.com, joint.inertia
        steps += joint_steps
    else:
        steps += [com_step] if com_step else []
    moving = _moving(trials, holds)
    if grasps is not None and com is not None:
        upstream = com.own_covariance[1:, 1:], com.grasp_jacobian
        if method == "staged":
            say("inertia")
            data = [trials[k].data for k in moving]
            inertia, step = estimate_inertia(data, grasps, com.p_1c, upstream)
            steps.append(step)
        say("each recording alone")
        for k in moving:
            records[k] = replace(records[k], inertia=_alone(trials[k], grasps, com, method))
        for k, trial in enumerate(trials):
            known = inertia or records[k].inertia
            force, moment = wrench_balance(trial.data, grasps, com.mass, com.p_1c, known)
            records[k] = replace(records[k], force_residual=force, moment_residual_m=moment)
            flags += balance_flags(trial.name, force, moment, grasps)
    if inertia is not None:
        flags += inertia_flags(inertia)
    doubts = {weak.reason for step in steps for weak in step.weak if CONTRADICTION in weak.reason}
    flags += [f"No centre of mass: {doubt}." for doubt in sorted(doubts)[:1]]
    if mass is None and inertia is None and (grasps is None or grasps.robots == 1):
        raise InputError(f"nothing can be estimated from these recordings: {_why(steps)}")
    if compare_masses and len(trials) > 1:
        say("the mass of each recording")
        check_one_payload(
            (trial.name, mass_alone(trial.data, found, record.grasps))
            for trial, found, record in zip(trials, holds, records, strict=True)
        )
    estimate = PayloadEstimate(
        payload=payload,
        robots=trials[0].data.robots,
        method=method,
        grasps=grasps,
        mass=mass,
        p_1c=None if com is None else com.p_1c,
        p_1c_covariance=None if com is None else com.covariance[1:, 1:],
        inertia=inertia,
        steps=tuple(steps),
        recordings=tuple(records),
        flags=tuple(flags),
        units=_units(trials),
    )
    return withheld(estimate, max(trial.team for trial in trials)) if withhold else estimate


def _holds(trial: Trial) -> list[Hold]:
    """Return static holds, with the rounding variance of their forces."""
    holds = find_holds(trial.data)
    return holds if trial.steps is None else [trial.steps.of_hold(hold) for hold in holds]


def _units(trials: Sequence[Trial]) -> ArmUnit | None:
    """Return the robots with their deviations, if all recordings agree on them."""
    first = trials[0].units
    same = first is not None and all(
        trial.units is not None and np.array_equal(trial.units.x, first.x) for trial in trials
    )
    return first if same else None


def _grasps(
    trials: Sequence[Trial], records: list[RecordingEstimate], flags: list[str]
) -> tuple[GraspEstimate | None, list[StepReport]]:
    """Estimate grasps from each recording alone (into ``records``), compare them, and estimate pooled grasps."""
    for k, trial in enumerate(trials):
        alone, steps = _grasps_of([trial])
        records[k] = replace(records[k], grasps=alone)
        if alone is not None:
            flags += check_rigid(trial.name, alone)
        else:
            check_disagreement_is_noise(trial.name, steps)
    found = [(record.name, record.grasps) for record in records if record.grasps is not None]
    check_agreement([name for name, _ in found], [grasps for _, grasps in found])
    pooled, steps = _grasps_of(trials)
    return pooled, list(steps)


def _grasps_of(trials: Sequence[Trial]) -> tuple[GraspEstimate | None, tuple[StepReport, ...]]:
    """Estimate grasps, and add the rounding errors of resting joints."""
    grasps, reports = estimate_grasps([trial.data for trial in trials])
    told = [trial.steps.still_rad2 / len(trials) ** 2 for trial in trials if trial.steps is not None]
    return (grasps.rounded(np.sum(told, axis=0)) if grasps and told else grasps), reports


def _moving(trials: Sequence[Trial], holds: Sequence[Sequence[Hold]]) -> list[int]:
    rest = [sum(hold.end_s - hold.start_s for hold in found) for found in holds]
    length = [float(trial.data.time[-1] - trial.data.time[0]) for trial in trials]
    moving = [k for k in range(len(trials)) if rest[k] <= RESTING * length[k]]
    return moving or list(range(len(trials)))


def _alone(trial: Trial, grasps: GraspEstimate, com: ComEstimate, method: str) -> InertiaEstimate | None:
    if method == "joint":
        return estimate_joint([trial.data], grasps)[0].inertia
    upstream = com.own_covariance[1:, 1:], com.grasp_jacobian
    return estimate_inertia([trial.data], grasps, com.p_1c, upstream)[0]


def inertia_flags(inertia: InertiaEstimate) -> list[str]:
    """Return caveats on an inertia, one sentence each."""
    flags = []
    if inertia.projected:
        flags.append("The least-squares inertia had a negative eigenvalue, which was replaced by zero.")
    moments, se = inertia.principal.moments, inertia.principal.moments_se
    excess, excess_se = moments[2] - moments[0] - moments[1], float(np.sqrt(np.sum(se**2)))
    if excess > max(3 * excess_se, 0.02 * moments[2]):
        flags.append("The largest principal moment exceeds the sum of the others: no real body has that.")
    if inertia.principal.R_1c is None:
        flags.append("Two principal moments are equal within their errors, so their axes are not determined.")
    if inertia.residual_rms > 0.5 * inertia.moment_rms:
        share = inertia.residual_rms / inertia.moment_rms
        flags.append(
            f"The moments follow the motion poorly (residual {100 * share:.0f} % of what is explained)."
        )
    return flags


def _why(steps: Sequence[StepReport]) -> str:
    weak = [str(weak) for step in steps for weak in step.weak]
    if not weak:
        return "there is no static hold and no motion"
    more = f" (and {len(weak) - 1} more)" if len(weak) > 1 else ""
    return weak[0] + more


def _distinct(names: Sequence[str]) -> list[str]:
    """Append a running number to repeated names."""
    seen: dict[str, int] = {}
    out = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return out
