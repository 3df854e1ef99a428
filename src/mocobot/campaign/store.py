"""A campaign's folder: what it is of, and a file for every set that is done.

config.json        what its sets depend on, as text by name; a campaign with other values is not mixed with them
sets/KEY.json      the result of a set (``campaign.run``); it appears whole or not at all
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from estimator.errors import InputError
from estimator.files import make_folder, write_json
from estimator.strict import read_json
from mocobot.campaign.folder import CONFIG, FORMAT, SETS, VERSION
from mocobot.campaign.plan import CampaignSet


class CampaignStore:
    """Results of sets, kept as they end.

    Attributes:
        out: the folder.
    """

    def __init__(self, out: Path, config: Mapping[str, str], *, force: bool = False) -> None:
        """Open a campaign's folder, or begin one.

        Args:
            out: the folder.
            config: what sets depend on.
            force: drop what another campaign left there.

        Raises:
            InputError: it is another campaign's, cannot be read, or cannot be written.
        """
        self.out = out
        file = out / CONFIG
        if file.is_file() and (what := _difference(_read(file), config)):
            if not force:
                raise InputError(
                    f"{out}: holds a campaign with {what}; give --force to drop it, or name a new folder"
                )
            for result in (out / SETS).glob("*.json"):
                if (
                    read_json(result, "the result of a campaign's set").get("set", {}).get("key")
                    == result.stem
                ):
                    result.unlink()
            file.unlink()
        make_folder(out / SETS)
        if not file.is_file():
            write_json(file, {"format": FORMAT, "version": VERSION, "config": dict(config)})

    def has(self, one: CampaignSet) -> bool:
        """Whether a set is done."""
        return self.file(one).is_file()

    def get(self, one: CampaignSet) -> dict[str, Any]:
        """The result of a set.

        Raises:
            InputError: it is not there, or cannot be read.
        """
        found = read_json(self.file(one), "the result of a campaign's set")
        if found.get("set") != json.loads(json.dumps(one.to_dict())):
            raise InputError(f"{self.file(one)}: is not the result of that set; delete it")
        return found

    def put(self, result: Mapping[str, Any]) -> None:
        """Keep a result.

        Raises:
            InputError: it cannot be written.
        """
        write_json(self.out / SETS / f"{result['set']['key']}.json", result)

    def file(self, one: CampaignSet) -> Path:
        """Where the result of a set is."""
        return self.out / SETS / f"{one.key}.json"


def _read(file: Path) -> dict[str, Any]:
    values = read_json(file, "what a campaign is of")
    config = values.get("config")
    if values.get("format") != FORMAT or not isinstance(config, dict):
        raise InputError(f"{file}: is not of a campaign; name a new folder")
    return config


def _difference(there: Mapping[str, Any], here: Mapping[str, str]) -> str:
    """The first value that is not the same, in words; empty if there is none."""
    for name in here:
        if there.get(name) != here[name]:
            if name == "code":
                return "another version of mocobot or of its libraries"
            return f"{name} {there.get(name)}, not {here[name]}"
    return ""
