"""Make one HTML page from a result folder; this module has the names of its files."""

from pathlib import Path

from estimator.errors import InputError
from estimator.files import system_errors

NAME, SUFFIX = "report.html", ".html"
CAMPAIGN_FORMAT = "mocobot-campaign"
SOUGHT = (
    "paper.json of `mocobot paper --out`, diagnosis.json of `mocobot diagnose --out`, calibration.json of "
    "`mocobot calibrate --out`, campaign.json of `mocobot campaign --out`, or JSON files of `mocobot estimate --out`"
)


def check_folder(folder: Path) -> None:
    """Refuse a path that does not exist or is a file."""
    with system_errors(folder, "read"):
        if not folder.exists():
            raise InputError(f"{folder}: there is no such folder; it must hold {SOUGHT}")
        if not folder.is_dir():
            raise InputError(f"{folder}: is a file; name the folder that holds it")
