"""What ``mocobot paper`` refuses at once."""

from pathlib import Path

from estimator.errors import InputError
from estimator.files import check_place
from mocobot.files.targets import check_folder
from mocobot.options import Paper
from mocobot_sim.scene.model_files import payload_path

SCORES, PARTIAL = "paper.json", "partial"


def check(options: Paper) -> None:
    """Everything that can be refused before the experiment is planned.

    Raises:
        InputError: an option or an output that cannot be met.
    """
    for payload in options.payload:
        payload_path(payload)
    if options.recordings and not options.out:
        raise InputError("--recordings needs --out")
    if options.jobs < 1:
        raise InputError(f"jobs is {options.jobs}; it must be at least 1")
    if options.out and _is_interrupted(options.out):
        check_place(options.out)
    elif options.out:
        check_folder(options.out, [], _is_paper, "an earlier experiment", force=options.force)


def _is_interrupted(folder: Path) -> bool:
    """Whether a folder holds parts of a run, and beside them nothing or its results, which are written at the end.

    Which run's, the command finds out.
    """
    names = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    return names == {PARTIAL} or names >= {PARTIAL, SCORES}


def _is_paper(folder: Path) -> bool:
    return (folder / SCORES).is_file()
