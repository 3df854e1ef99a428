"""What a campaign's folder is known by; nothing else is loaded, so that a command can look at once."""

import json
from pathlib import Path

CONFIG, SETS, SUMMARY, REPORT, TABLE = "config.json", "sets", "campaign.json", "report.txt", "sets.csv"
FORMAT, VERSION = "mocobot-campaign-config", 1


def is_campaign(folder: Path) -> bool:
    """Whether a folder holds a campaign, whole or begun."""
    try:
        return json.loads((folder / CONFIG).read_text(encoding="utf-8"))["format"] == FORMAT
    except (OSError, ValueError, TypeError, KeyError):
        return False
