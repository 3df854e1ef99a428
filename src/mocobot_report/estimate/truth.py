"""An estimate against the truth beside a simulated recording."""

import numpy as np

from estimator.estimate.result import PayloadEstimate
from mocobot_report.blocks.html import Node
from mocobot_report.blocks.numbers import NONE
from mocobot_report.blocks.tables import Entry, Num, quantity, table, value
from mocobot_sim.paper.scoring import rotation_error_deg
from mocobot_view.facts.body_facts import BodyFacts


def errors_table(e: PayloadEstimate, truth: BodyFacts) -> Node:
    """Truth, error, error in percent and in standard errors, for every number that both have."""
    rows: list[list[Entry]] = []

    def row(
        name: str,
        unit: str,
        true: float,
        found: float | None,
        se: float | None,
        scale: float = 1.0,
        of: float = 0.0,
    ) -> None:
        of = of or true
        known: list[float | None] = [None, None, None]
        if found is not None:
            error = found - true
            known = [
                scale * error,
                100.0 * abs(error / of) if of else None,
                abs(error) / se if se else None,
            ]
        rows.append([quantity(name), unit, value(scale * true, 5), *(value(v, 2) for v in known)])

    if truth.mass_kg is not None:
        row("mass", "kg", truth.mass_kg, e.mass and e.mass.mass, e.mass and e.mass.se)
    if truth.p_1c is not None:
        p, errors = e.p_1c, e.p_1c_se_m
        for k, name in enumerate("xyz"):
            found, se = (None, None) if p is None or errors is None else (float(p[k]), float(errors[k]))
            row(f"p_1c {name}", "mm", float(truth.p_1c[k]), found, se, 1e3, float(np.linalg.norm(truth.p_1c)))
    if truth.principal_kgm2 is not None:
        for k, true in enumerate(np.sort(truth.principal_kgm2)):
            p = None if e.inertia is None else e.inertia.principal
            found, se = (None, None) if p is None else (float(p.moments[k]), float(p.moments_se[k]))
            row(f"principal moment {k + 1}", "kg m²", float(true), found, se)
    if truth.grasps is not None:
        for j in range(2, len(truth.grasps.p_1i) + 1):
            true = truth.grasps.p_1i[j - 1]
            pair = None if e.grasps is None else e.grasps.pair(1, j)
            for k, name in enumerate("xyz"):
                found, se = (None, None) if pair is None else (float(pair.p_ij[k]), float(pair.p_se_m[k]))
                row(f"p_1{j} {name}", "mm", float(true[k]), found, se, 1e3, float(np.linalg.norm(true)))
            if e.grasps is not None:
                angle = rotation_error_deg(truth.grasps.R_1i[j - 1], e.grasps.R_1i[j - 1])
                rows.append([quantity(f"R_1{j}"), "deg", Num(NONE), value(angle, 2), Num(NONE), Num(NONE)])
    head = ["", "unit", "truth", "error", "error [%]", "in standard errors"]
    note = "error of a rotation: its angle; error [%] of a component: share of the vector's length"
    return table("Estimate against truth", head, rows, note=note)
