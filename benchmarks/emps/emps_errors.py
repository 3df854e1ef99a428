"""Are the standard errors right? The sandwich over blocks beside a bootstrap of the same blocks and the naive ones.

python benchmarks/emps/emps_errors.py
"""

from __future__ import annotations

import numpy as np

from discrepancy.emps.diagnosis import diagnose_axis
from discrepancy.emps.recording.reader import read_emps
from discrepancy.emps.rig import EmpsRig
from discrepancy.least_squares.block_errors import block_covariance, part_of, weighted_rows
from discrepancy.least_squares.fit import Fit
from emps_data import DATA, PULSES, needed_folder

DRAWS = 2000
BLOCKS_S = (0.25, 0.5, 1.0, 2.0, 3.0)


def bootstrap(fit: Fit, rows_per_block: int, rng: np.random.Generator, draws: int = DRAWS) -> np.ndarray:
    """Standard deviations of a fit's solution over resampled blocks of rows, in units, shape (used,)."""
    grams = []
    for t in fit.problem.trials:
        rows = weighted_rows(fit.problem, t)
        count = max(1, round(len(rows) / rows_per_block))
        for part in np.array_split(np.arange(len(rows)), count):
            flat = rows[part].reshape(-1, rows.shape[2])
            grams.append(flat.T @ flat)
    blocks = np.array(grams)
    solutions = []
    for _ in range(draws):
        gram = blocks[rng.integers(0, len(blocks), len(blocks))].sum(axis=0)
        solutions.append(Fit.of_gram(fit.problem, gram, fit.free).solution)
    return np.std(solutions, axis=0)


def main() -> None:
    """Print standard errors of every named parameter."""
    folder, rng = needed_folder(), np.random.default_rng(0)
    for name in (DATA, PULSES):
        rig = EmpsRig.of(read_emps(folder / name))
        explanation = diagnose_axis(rig, closed_loop=False).explanation
        fit, rate = explanation.fit, rig.row_rate_hz(0)
        drawn = bootstrap(fit, round(rate), rng)
        print(
            f"\n{name}: naive, sandwich over blocks of {', '.join(map(str, BLOCKS_S))} s, bootstrap of blocks of 1 s"
        )
        for index in fit.free:
            candidate = explanation.problem.candidates[index]
            at = fit.at(index)
            naive = np.sqrt(np.diag(fit.part(index)[1])) * candidate.units
            sandwich = [
                np.sqrt(np.diag(part_of(fit, block_covariance(fit, round(s * rate)), index)))
                * candidate.units
                for s in BLOCKS_S
            ]
            for k, parameter in enumerate(candidate.parameters):
                cells = "".join(f"{s[k]:>10.3g}" for s in [naive, *sandwich, drawn[at] * candidate.units])
                print(f"    {candidate.cause:<20}{parameter.name:<20}{cells}")


if __name__ == "__main__":
    main()
