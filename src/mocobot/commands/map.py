"""``mocobot map``: draft the map of a log."""

import sys
from pathlib import Path

from estimator.files import write_text
from mocobot.options import Map
from mocobot_logs.draft import Draft, draft_of


def run(options: Map) -> None:
    """Run the command; doubts are in the draft, and counted on standard error.

    Raises:
        InputError: the log cannot be read, or the draft not be written.
    """
    if options.model is not None:
        _run_joints(options, options.model)
        return
    draft = draft_of(options.log, options.episode)
    if options.out is None:
        print(draft.text, end="")
    else:
        write_text(options.out, draft.text)
    print(f"mocobot: {_summary(draft)}", file=sys.stderr)


def _run_joints(options: Map, model: Path) -> None:
    """The map of a log of one robot's joints."""
    from discrepancy.joints.model import load_model
    from mocobot_logs.draft import draft_joint_map

    robot = load_model(model)
    draft = draft_joint_map(options.log, robot.joints, [bool(s) for s in robot.slides], options.episode)
    if options.out is None:
        print(draft.text, end="")
    else:
        write_text(options.out, draft.text)
    count = len(robot.joints)
    doubts = f"{draft.doubtful} doubtful line{'s' * (draft.doubtful != 1)} must be looked at"
    lacking = (
        f"; the draft is not complete: {', '.join(draft.missing)} must be filled in" if draft.missing else ""
    )
    print(f"mocobot: {count} joint{'s' * (count > 1)}; {doubts}{lacking}", file=sys.stderr)


def _summary(draft: Draft) -> str:
    robots = f"{draft.robots} robot{'s' * (draft.robots > 1)}"
    if draft.missing:
        return f"{robots}; the draft is not complete: {', '.join(draft.missing)} must be filled in"
    if draft.doubtful:
        return f"{robots}; {draft.doubtful} doubtful line{'s' * (draft.doubtful > 1)} must be looked at"
    return f"{robots}; nothing is doubtful"
