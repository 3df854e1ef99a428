"""Calls for a single robot in MJCF or URDF."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from discrepancy.joints.model import SerialModel
from mocobot.api.diagnosis import Diagnosis
from mocobot.api.diagnosis import diagnose as _diagnose
from mocobot.api.inspection import JointInspection
from mocobot.api.inspection import inspect as _inspect
from mocobot.api.joints import GivenLogs, GivenModel, read_logs, read_model
from mocobot_logs.joints.joint_log import JointLog
from mocobot_sim.serial.example import write_example

__all__ = [
    "JointInspection", "JointLog", "SerialModel", "diagnose", "inspect", "read_logs", "read_model",
    "write_example",
]  # fmt: skip


def inspect(log: Path | str, model: GivenModel, **options: Any) -> JointInspection:
    """Inspect a joint log of one robot; see ``mocobot.inspect``."""
    found = _inspect(log, model, **options)
    assert isinstance(found, JointInspection)
    return found


def diagnose(
    model: GivenModel, logs: GivenLogs, *, reference: GivenLogs | Iterable[Any] = (), **options: Any
) -> Diagnosis:
    """Diagnose joint logs of one robot; see ``mocobot.diagnose``."""
    return _diagnose(logs, model, reference, **options)
