"""The part of the report that says what the causes are worth: response to the commands, and payload estimates."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from discrepancy.numbers import Shown, one_each
from discrepancy.result.remains import all_as_found

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
        lines += _table(gain["errors"], ERRORS, named=known)
    if "estimates" in gain and known:
        lines += ["", "[[Payload's estimate]]", *_table(*_rows(gain["estimates"]), named=True)]
    return lines


def something_is_off(values: Values) -> bool:
    """Whether the payload is to be told with what is off: a cause is named, or the robots are found all the same."""
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
        yield _row(f"{channel} rms [{shown}]", rms, named=named, last=noise, width=width)
        yield _row(f"{channel} rms / motion [%]", share, named=named, width=width)
    yield _row("chi2/n", [before["chi2_per_n"], after["chi2_per_n"]], named=named, last=1.0, width=width)
    if gain["removed"] is not None and named:
        low, high = gain["removed"]["interval"]
        count = sum(t["before"] is not None and t["after"] is not None for t in gain["trials"])
        text = f"    {100 * gain['removed']['share']:.1f} % of the excess error removed"
        if low is not None and high is not None and count > 1:
            text += f" (95 % interval over {count} trials: {100 * low:.1f} to {100 * high:.1f} %)"
        yield text
    yield from (f"    chi2/n {found}" for found in all_as_found(gain))


def foretold_torques(gain: Values) -> bool:
    """Whether the channels are torques of a serial robot, foretold from its motion: no commands are needed for them."""
    return all(channel.endswith(" torque") for channel in gain["units"])


def floor_words(gain: Values) -> str:
    """What is left at best."""
    return "noise" if foretold_torques(gain) else "noise and integration error"


def answer(gain: Values) -> str:
    """What is held against the recordings."""
    if foretold_torques(gain):
        return "Torques, foretold from the recorded motion"
    return "Response to the recorded commands, simulated again"


def response_units(gain: Values) -> dict[str, Shown]:
    """In which unit every channel's error is shown: one for all channels of a kind, by the largest error."""
    errors = [gain["held_out"]["before"], *(trial["before"] for trial in gain["trials"])]
    shown = one_each(
        (unit, error[f"{channel}_rms"])
        for error in errors
        if error
        for channel, unit in gain["units"].items()
    )
    return {channel: shown[unit] for channel, unit in gain["units"].items()}


def _rows(estimates: Values) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Numbers of an estimate by label: mass, centre of mass, moments, distances of the grasps."""
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


def _table(values: Values, labels: Mapping[str, str], *, named: bool) -> Iterable[str]:
    if named:
        yield f"    {'':<26}{'before':>14}{'after':>14}"
    for key, label in labels.items():
        yield _row(label, [values["before"][key], values["after"][key]], named=named)


def _row(label: str, numbers: list[float], *, named: bool, last: float | None = None, width: int = 26) -> str:
    shown = (numbers if named else numbers[:1]) + ([] if last is None else [last])
    return f"    {label:<{width}}" + "".join(f"{x:>14.4g}" for x in shown)
