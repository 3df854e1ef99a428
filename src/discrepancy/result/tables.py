"""Tables of the report: closed-loop gain, payload estimates and rollouts (keys: ``joints.rolled``)."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from discrepancy.numbers import Shown, one_each
from discrepancy.result.remains import all_as_found

WIDTH = 100
"""Maximum line length."""
Values = Mapping[str, Any]
ERRORS = {
    "mass_percent": "mass [%]",
    "com_mm": "centre of mass [mm]",
    "principal_inertia_percent": "principal inertia [%]",
    "grasp_rotation_deg": "grasp rotation [deg]",
    "grasp_position_mm": "grasp position [mm]",
}


def gain_lines(values: Values) -> list[str]:
    """Closed loop and estimates, before and after, as lines of at most 100 columns."""
    gain = values["gain"]
    if gain is None:
        return []
    lines, known = list(_closed_loop(gain, named=bool(values["causes"]))), something_is_off(values)
    if "errors" in gain:
        lines += ["", "[[Error of the payload's estimate (the truth is known)]]"]
        lines += _compared(gain["errors"], ERRORS, named=known)
    if "estimates" in gain and known:
        lines += ["", "[[Payload's estimate]]", *_compared(*_estimates(gain["estimates"]), named=True)]
    return lines


def something_is_off(values: Values) -> bool:
    """Whether to compare payload estimates: a cause is named, or the verdict is miscalibrated."""
    return bool(values["causes"]) or values["verdict"] == "miscalibrated"


def _closed_loop(gain: Values, *, named: bool) -> Iterable[str]:
    before, after = (gain["held_out"][name] for name in ("before", "after"))
    if before is None or after is None:
        return
    what = "on trials left out of the fit" if gain["validated"] else "on trials in the fit: not validated"
    yield from ("", f"[[{answer(gain)} ({what})]]")
    heads = ["before", "after", "noise alone"] if named else ["error", "noise alone"]
    units = response_units(gain)
    width = max(26, *(len(f"{channel} rms / motion [%]") for channel in units))
    yield f"    {'':<{width}}" + "".join(f"{head:>14}" for head in heads)
    for channel in gain["units"]:
        shown, scale = units[channel]
        noise = scale * gain["noise"][f"{channel}_rms"]
        rms = [scale * which[f"{channel}_rms"] for which in (before, after)]
        share = [100.0 * which[f"{channel}_nrmse"] for which in (before, after)]
        yield _numbers_line(f"{channel} rms [{shown}]", rms, named=named, last=noise, width=width)
        yield _numbers_line(f"{channel} rms / motion [%]", share, named=named, width=width)
    yield _numbers_line(
        "chi2/n", [before["chi2_per_n"], after["chi2_per_n"]], named=named, last=1.0, width=width
    )
    if gain["removed"] is not None and named:
        low, high = gain["removed"]["interval"]
        count = sum(t["before"] is not None and t["after"] is not None for t in gain["trials"])
        text = f"    {100 * gain['removed']['share']:.1f} % of the excess error removed"
        if low is not None and high is not None and count > 1:
            text += f" (95 % interval over {count} trials: {100 * low:.1f} to {100 * high:.1f} %)"
        yield text
    yield from (f"    chi2/n {found}" for found in all_as_found(gain))


def predicted_torques(gain: Values) -> bool:
    """Whether the channels are joint torques, predicted from motion without commands."""
    return all(channel.endswith(" torque") for channel in gain["units"])


def floor_words(gain: Values) -> str:
    """Name of the smallest possible error."""
    return "noise" if predicted_torques(gain) else "noise and integration error"


def answer(gain: Values) -> str:
    """Name of the quantity that is compared with the recordings."""
    if predicted_torques(gain):
        return "Torques, predicted from the recorded motion"
    return "Response to the recorded commands, simulated again"


def response_units(gain: Values) -> dict[str, Shown]:
    """Display unit of each channel's error; channels of one kind share the unit that fits the largest error."""
    errors = [gain["held_out"]["before"], *(trial["before"] for trial in gain["trials"])]
    shown = one_each(
        (unit, error[f"{channel}_rms"])
        for error in errors
        if error
        for channel, unit in gain["units"].items()
    )
    return {channel: shown[unit] for channel, unit in gain["units"].items()}


def _estimates(estimates: Values) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Values of an estimate by label: mass, centre of mass, principal moments, grasp distances."""
    table: dict[str, dict[str, float]] = {}
    for name, estimate in estimates.items():
        row = {"mass [kg]": estimate["mass_kg"]}
        row |= {f"centre of mass {a} [m]": v for a, v in zip("xyz", estimate["p_1c_m"], strict=True)}
        row |= {
            f"principal {k} [kg m^2]": v for k, v in enumerate(estimate["principal_inertia_kgm2"], start=1)
        }
        for i, grasp in enumerate(estimate["grasps"], start=1):
            if i > 1:
                row[f"distance of grasp {i} [m]"] = float(np.linalg.norm(grasp["p_1i_m"]))
        table[name] = row
    return table, {label: label for label in table["before"]}


def _compared(values: Values, labels: Mapping[str, str], *, named: bool) -> Iterable[str]:
    if named:
        yield f"    {'':<26}{'before':>14}{'after':>14}"
    for key, label in labels.items():
        yield _numbers_line(label, [values["before"][key], values["after"][key]], named=named)


def _numbers_line(
    label: str, numbers: list[float], *, named: bool, last: float | None = None, width: int = 26
) -> str:
    shown = (numbers if named else numbers[:1]) + ([] if last is None else [last])
    return f"    {label:<{width}}" + "".join(f"{x:>14.4g}" for x in shown)


FREE = "Rolled out from measured states under the logged torques"
LOOP = "Rolled out under the logged commands, loops closed"
ROLLED = "rms error of the position, of the given model -> of the extended one (share removed)"


def rollout_lines(values: Values) -> list[str]:
    """Position errors of each joint before and after, as lines of at most 100 columns; empty without rollouts."""
    rolled = values.get("rollouts")
    if rolled is None:
        return []
    lines = (
        list(_free(rolled)) if rolled["why_not"] is None else [f"Not rolled out freely: {rolled['why_not']}."]
    )
    return ["", f"[[{FREE} ({blocks(rolled)})]]", *_indented(lines), *_loop(rolled)]


def _indented(lines: Iterable[str]) -> Iterable[str]:
    for line in lines:
        indented = f"    {line}"
        if len(indented) <= WIDTH:
            yield indented
        else:
            yield from textwrap.wrap(line, WIDTH, initial_indent="    ", subsequent_indent="    ")


def blocks(rolled: Values) -> str:
    """Whether the blocks were held out, in words."""
    return "on blocks left out of the fit" if rolled["validated"] else "on the block itself: not validated"


def _free(rolled: Values) -> Iterable[str]:
    horizons = rolled["horizons"]
    if horizons[0]["after"] is not None:
        yield ROLLED
    heads = [f"{h['seconds']:g} s ahead" for h in horizons]
    shown = shown_units(rolled)
    rows = []
    for j in range(len(rolled["joints"])):
        _, scale = shown[rolled["units"][j]]
        cells = []
        for h in horizons:
            after = None if h["after"] is None else h["after"]["rms"][j]
            removed = None if h["removed"] is None else h["removed"][j]
            cells.append(_cell(h["before"]["rms"][j], after, removed, scale, named=h["after"] is not None))
        rows.append(cells)
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    called = _called(rolled, shown, WIDTH - 4 - sum(widths) - 2 * len(widths))
    for name, cells in zip(["joint", *called], [heads, *rows], strict=True):
        line = (f"  {cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
        yield f"{name:<{max(map(len, called))}}" + "".join(line)
    yield from diverged_sentences(rolled)
    if rolled["not_simulated"]:
        yield f"Not in the rollouts: {', '.join(rolled['not_simulated'])}."
    yield from rolled["refused"]


def _called(rolled: Values, shown: Mapping[str, Shown], room: int) -> list[str]:
    """Joint names with units; joint numbers if names are too long, because shortened names may be equal."""
    units = [shown[unit][0] for unit in rolled["units"]]
    named = [f"{name} [{unit}]" for name, unit in zip(rolled["joints"], units, strict=True)]
    if max(map(len, named)) <= room:
        return named
    return [f"joint {j} [{unit}]" for j, unit in enumerate(units, start=1)]


def _cell(
    before: float | None, after: float | None, removed: float | None, scale: float, *, named: bool
) -> str:
    text = _error(before, scale)
    if not named:
        return text
    share = "" if removed is None else f" ({100.0 * removed:.0f} %)"
    return f"{text} -> {_error(after, scale)}{share}"


def _error(value: float | None, scale: float) -> str:
    return "diverged" if value is None else f"{scale * value:.3g}"


def diverged_sentences(rolled: Values) -> Iterable[str]:
    """Sentences on the number of diverged rollouts, by model and horizon."""
    for which, words in (("before", "the given model"), ("after", "the extended model")):
        counts = [
            f"{max(h[which]['diverged'])} of {h['starts']} at {h['seconds']:g} s"
            for h in rolled["horizons"]
            if h[which] is not None and max(h[which]["diverged"])
        ]
        if counts:
            listed = ", ".join(counts)
            yield f"Rollouts of {words} that diverged in the worst joint: {listed}; they are not in its errors."


def shown_units(rolled: Values) -> dict[str, Shown]:
    """Display units of errors of revolute and prismatic joints, chosen by the first horizon."""
    free = [(h[which] or {}).get("rms", []) for h in rolled["horizons"][:1] for which in ("before", "after")]
    loop = [rolled["commanded"][which] or [] for which in ("before", "after")]
    return one_each(
        (rolled["units"][j], x or 0.0)
        for errors in (*free, *loop, [0.0] * len(rolled["units"]))
        for j, x in enumerate(errors)
    )


def _loop(rolled: Values) -> Iterable[str]:
    loop = rolled["commanded"]
    if loop["why_not"] is not None:
        yield from _indented([f"The closed loop was not simulated: {loop['why_not']}."])
        return
    yield from ("", f"[[{LOOP} ({blocks(rolled)})]]", *_indented(_loop_errors(rolled, loop)))


def _loop_errors(rolled: Values, loop: Values) -> Iterable[str]:
    shown = shown_units(rolled)
    named = loop["after"] is not None
    cells = []
    for j in range(len(rolled["joints"])):
        _, scale = shown[rolled["units"][j]]
        after, removed = (loop[key][j] if named else None for key in ("after", "removed"))
        cell = _cell(loop["before"][j], after, removed, scale, named=named)
        cells.append(cell)
    called = _called(rolled, shown, WIDTH - 4 - 2 - max(map(len, cells)))
    for name, cell in zip(called, cells, strict=True):
        yield f"{name:<{max(map(len, called))}}  {cell:>{max(map(len, cells))}}"
    for which, words in (("before", "the given model"), ("after", "the extended model")):
        count = lost(loop["blocks"], which)
        if count:
            yield f"{count} of {len(loop['blocks'])} blocks of {words} diverged; they are in no error."


def lost(runs: Sequence[Values], which: str) -> int:
    """Number of blocks in which some joint diverged."""
    return sum(run[which] is not None and None in run[which] for run in runs)
