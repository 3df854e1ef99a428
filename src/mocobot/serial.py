"""Any robot in MJCF or URDF: the calls of ``mocobot`` that take a model, with the model where scripts have it."""

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

__all__ = ["JointInspection", "JointLog", "SerialModel", "diagnose", "inspect", "read_logs", "read_model"]


def inspect(log: Path | str, model: GivenModel, **options: Any) -> JointInspection:
    """``mocobot.inspect`` with a model."""
    found = _inspect(log, model, **options)
    assert isinstance(found, JointInspection)
    return found


def diagnose(
    model: GivenModel, logs: GivenLogs, *, reference: GivenLogs | Iterable[Any] = (), **options: Any
) -> Diagnosis:
    """``mocobot.diagnose`` with a model."""
    return _diagnose(logs, model, reference, **options)
