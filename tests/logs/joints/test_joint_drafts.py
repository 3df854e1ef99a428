"""Drafts of joint maps: units in names, and text with decimal commas."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from joint_logs import write_table
from mocobot_logs.draft import draft_joint_map

JOINTS = ("shoulder", "elbow")


def written(folder: Path, names: list[str], *, comma: bool = False) -> Path:
    values = np.random.default_rng(0).standard_normal((200, len(names) - 1)) * 20.0
    text = [";".join(names)]
    for k, row in enumerate(values):
        cells = ";".join([f"{0.01 * k:.3f}", *(f"{x:.5f}" for x in row)])
        text.append(cells.replace(".", ",") if comma else cells)
    path = folder / "log.csv"
    path.write_text("\n".join(text) + "\n", encoding="utf-8-sig" if comma else "utf-8")
    return path


@pytest.mark.parametrize(
    ("called", "said"),
    [
        ("torque_{}_Nmm", '"Nmm"'),
        ("torque {} [mNm]", '"mNm"'),
        ("Position {} [deg]", '"deg"'),
        ("velocity_{} (deg/s)", '"deg/s"'),
        ("motor speed {} [rpm]", '"rpm"'),
        ("current {} [mA]", '"mA"'),
    ],
)
def test_units_in_names_are_read(tmp_path, called: str, said: str) -> None:
    path = written(tmp_path, ["time", called.format(1), called.format(2)])
    (line,) = (s for s in draft_joint_map(path, JOINTS, [False, False]).text.splitlines() if "{number}" in s)
    assert f"unit = {said} }}  # -" in line, line  # and what the column holds, without a doubt


@pytest.mark.parametrize(("size", "unit"), [(1.0, "m"), (300.0, "mm")])
def test_slides_that_go_far_are_logged_in_millimetres(tmp_path, size: float, unit: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(
        "time,pos_1,pos_2\n" + "".join(f"{0.01 * k},{size * k / 100},{-size}\n" for k in range(100))
    )
    assert f'unit = "{unit}" }}  # doubtful: unit?' in draft_joint_map(path, JOINTS, [True, True]).text


def test_decimal_commas_are_seen(tmp_path) -> None:
    names = ["time", "q_1_deg", "q_2_deg", "torque_1_Nm", "torque_2_Nm"]
    draft = draft_joint_map(written(tmp_path, names, comma=True), JOINTS, [False, False])
    assert '[csv]\ndecimal = ","' in draft.text
    assert draft.doubtful == 0
    assert "[csv]" not in draft_joint_map(written(tmp_path, names), JOINTS, [False, False]).text


@pytest.mark.parametrize("suffix", ["csv", "mat", "npz", "parquet"])
def test_names_that_mean_nothing(tmp_path: Path, suffix: str) -> None:
    path, columns = tmp_path / f"log.{suffix}", {"a": np.arange(50.0), "b": np.ones(50)}
    if suffix == "mat":
        savemat(path, columns, oned_as="column")
    else:
        write_table(path, columns)
    draft = draft_joint_map(path, JOINTS, [False, False])
    assert draft.missing == ("a position", "a torque, a current, a command or a duty")
    assert "# not used: a, b" in draft.text
