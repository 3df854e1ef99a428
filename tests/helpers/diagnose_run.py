"""Run ``mocobot diagnose`` in a test, and spoil recordings for it."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pyarrow as pa
import pytest

import command

BIAS_NM = 0.08
"""Torque zero that the recordings hide in robot 2, joint 1."""
Edit = Callable[[pa.Table], pa.Table]


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of ``mocobot diagnose``."""
    return command.run(capsys, "diagnose", *arguments)


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The one sentence of ``mocobot diagnose`` where it must exit with 2."""
    return command.refused(capsys, "diagnose", *arguments)


def with_metadata(**changes: object) -> Edit:
    def edit(table: pa.Table) -> pa.Table:
        values = json.loads(table.schema.metadata[b"mocobot"]) | changes
        return table.replace_schema_metadata({b"mocobot": json.dumps(values).encode()})

    return edit


def without_robots(count: int) -> Edit:
    """Only the first robots' columns."""

    def edit(table: pa.Table) -> pa.Table:
        first = tuple(f"omnid{i}." for i in range(1, count + 1))
        names = [name for name in table.column_names if name == "time" or name.startswith(first)]
        return with_metadata(robots=count)(table.select(names))

    return edit


def changed(part: str, change: Callable[[np.ndarray], np.ndarray]) -> Edit:
    """Every column whose name contains a part."""

    def edit(table: pa.Table) -> pa.Table:
        for k, name in enumerate(table.column_names):
            if part in name and name != "time":
                values = pa.array(change(table.column(name).to_numpy().copy()))
                table = table.set_column(k, name, values)
        return table

    return edit


def unlabelled_and_heavier(table: pa.Table) -> pa.Table:
    return with_metadata(payload=None)(changed(".tau", lambda v: 1.2 * v)(table))


def of_longer_links(table: pa.Table) -> pa.Table:
    design = json.loads(table.schema.metadata[b"mocobot"])["design"]
    return with_metadata(design=design | {"proximal_length_m": 1.01 * design["proximal_length_m"]})(table)
