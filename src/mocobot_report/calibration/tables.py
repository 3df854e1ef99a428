"""Tables of a calibration: every robot's deviations, what was carried, how every recording fits."""

from __future__ import annotations

import numpy as np

from estimator.arm.unit import AT
from estimator.calibrate.calibration import Calibration, carried, grasps_of
from estimator.calibrate.text import DEG, MASSES, SHOWN, alike, shown_groups
from mocobot_report.blocks.html import Node
from mocobot_report.blocks.numbers import NONE, plain
from mocobot_report.blocks.tables import Entry, Num, component, measurement, quantity, table
from mocobot_report.blocks.units import short_names


def deviation_tables(calibration: Calibration) -> list[Node]:
    """One table per robot: legs, or axes, side by side, and what was assumed beforehand."""
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


def payload_table(calibration: Calibration) -> Node:
    """Mass, centre of mass, principal moments and grasps of every payload."""
    found = [carried(payload, calibration.scale_sd) for payload in calibration.payloads]
    rows: list[list[Entry]] = [["mass", "kg", *(measurement(f.mass_kg, f.mass_se_kg) for f in found)]]
    for k, axis in enumerate("xyz"):
        cells = (component(f.p_1c, f.p_1c_se_m, k, 1e3) for f in found)
        rows.append([quantity(f"p_1c {axis}"), "mm", *cells])
    for k in range(3):
        cells = (component(f.principal.moments, f.principal.moments_se, k) for f in found)
        rows.append([f"principal moment {k + 1}", "kg m²", *cells])
    for j in range(2, calibration.robots + 1):
        pairs = [grasps_of(payload, calibration.scale_sd).pair(1, j) for payload in calibration.payloads]
        for k, axis in enumerate("xyz"):
            cells = (component(pair.p_ij, pair.p_se_m, k, 1e3) for pair in pairs)
            rows.append([quantity(f"p_1{j} {axis}"), "mm", *cells])
        for k, axis in enumerate("xyz"):
            cells = (component(pair.axis_angle_rad, pair.axis_angle_se_rad, k, DEG) for pair in pairs)
            rows.append([quantity(f"R_1{j} {axis}"), "deg", *cells])
    names = ["value" if p.label is None else f"payload ({p.label})" for p in calibration.payloads]
    note = (
        "± standard error; p_1c: centre of mass in {1}; p_12, R_12: place and rotation vector of {2} in {1}"
    )
    return table("What was carried", ["", "unit", *names], rows, note=note)


def trial_table(calibration: Calibration) -> Node:
    """chi²/n of loops and balance of every recording: as designed, calibrated, left out."""
    names = short_names([trial.name for trial in calibration.trials])
    rows: list[list[Entry]] = []
    for name, trial in zip(names, calibration.trials, strict=True):
        cells = [
            Num(NONE if pair is None or not trial.count[k] else plain(pair[k], 3))
            for k in range(2)
            for pair in (trial.before, trial.after, trial.held_out)
        ]
        rows.append([name, trial.kind, Num(f"{trial.duration_s:.1f}"), *cells])
    head = ["recording", "trial", "length [s]"]
    head += [
        f"{kind}: {stage}"
        for kind in ("loops", "balance")
        for stage in ("designed", "calibrated", "left out")
    ]
    note = "chi²/n; 1 is noise alone; left out: foretold by a calibration from all other recordings"
    return table("Recordings", head, rows, note=note)
