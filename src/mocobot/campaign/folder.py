"""What a campaign's folder is known by; nothing else is loaded, so that a command can look at once."""

from pathlib import Path

from estimator.errors import InputError
from estimator.strict import read_json

CONFIG, SETS, SUMMARY, REPORT, TABLE = "config.json", "sets", "campaign.json", "report.txt", "sets.csv"
FORMAT, VERSION = "mocobot-campaign-config", 1


def is_campaign(folder: Path) -> bool:
    """Whether a folder holds a campaign, whole or begun."""
    try:
        return read_json(folder / CONFIG, "what a campaign is of").get("format") == FORMAT
    except InputError:
        return False
