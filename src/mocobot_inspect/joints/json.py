"""An inspection of a joint log as JSON, strict: no NaN, None where something is not known. SI units.

::

    format "mocobot-joint-inspection", version 1
    log           name, map, joints, columns
    stamps        samples, duration_s, rate_hz, jitter_rms_s, jitter_max_s, gaps, missing, longest_gap_s,
                  longest_gap_at_s, duplicates, repeats, backwards, farthest_back_s, farthest_back_at_s, recorder_s
    channels      by column ("q of joint1"): as in an inspection of a team's log
    parts         start_s, duration_s, samples, rate_hz, resampled, notes
    unchecked     why motion and torques were not looked at, or null
    joints        by joint: moves, misfit and misfit_undone (share of the torque that neither model nor friction
                  explains), gain (of the model's torque), position_step
    velocity, command     by joint: gain, gain_se, delay_s (null where noise hides it), delay_se_s, correlation,
                  possible (correlation that noise leaves)
    torque_delay  delay_s, delay_se_s, before, after; or null
    payload       whether the torques are those of a robot that carries something that the model lacks
    mistakes      kind, joints, sentence, alternatives, misfit_before, misfit_after
    findings      topic and sentence of all that is wrong
    ready         the last line of the text
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mocobot_inspect.joints.findings import joint_findings, words
from mocobot_inspect.joints.inspection import JointInspection
from mocobot_inspect.joints.lags import Follows
from mocobot_inspect.joints.text import joint_ready_line
from mocobot_inspect.json import plain, without

FORMAT, VERSION = "mocobot-joint-inspection", 1


def joint_inspection_dict(found: JointInspection) -> dict[str, Any]:
    """Plain JSON values."""
    joints, w = found.robot.joints, found.wiring
    first = found.logs[0] if found.logs else None
    return plain({
        "format": FORMAT,
        "version": VERSION,
        "log": {
            "name": found.name, "map": found.log_map.name, "joints": joints, "columns": len(found.channels)
        },
        "stamps": {"duration_s": found.timing.duration_s} | without(found.timing, "first_ns", "last_ns"),
        "channels": {c.name: without(c, "name") for c in found.channels},
        "parts": [
            {
                "start_s": log.start_s, "duration_s": float(log.time[-1]), "samples": len(log.time),
                "rate_hz": log.rate_hz, "resampled": log.resampled, "notes": log.notes,
            }
            for log in found.logs
        ],
        "unchecked": found.unchecked,
        "joints": {
            joint: {
                "moves": bool(found.moves[j]),
                "misfit": None if w is None else float(w.misfit[j]),
                "misfit_undone": None if w is None else float(w.undone[j]),
                "gain": None if w is None else float(w.gains[j]),
                "position_step": None if first is None else float(first.position_step[j]),
            }
            for j, joint in enumerate(joints)
        },
        "velocity": _follows(found.velocities, joints),
        "command": _follows(found.commands, joints),
        "torque_delay": found.delay,
        "payload": w is not None and w.payload is not None,
        "mistakes": [
            {
                "kind": f.mistake.kind,
                "joints": [joints[j] for j in f.mistake.joints],
                "sentence": words(f.mistake, joints),
                "alternatives": [words(m, joints) for m in f.alternatives],
                "misfit_before": f.before,
                "misfit_after": f.after,
            }
            for f in (() if w is None else w.found)
        ],
        "findings": joint_findings(found),
        "ready": joint_ready_line(found),
    })  # fmt: skip


def _follows(found: Sequence[Follows], joints: Sequence[str]) -> dict[str, Any]:
    return {joints[one.joint]: without(one, "joint") for one in found}
