"""What a run's outcomes depend on, as a key: a run with the same one may go on with them."""

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from mocobot.files.provenance import PACKAGES, version_of
from mocobot_sim.scene.models import models_dir

SOURCES = ("discrepancy", "estimator", "mocobot", "mocobot_logs", "mocobot_sim")


@cache
def code_digest() -> str:
    """SHA-256 of the code and the models that outcomes come from."""
    top, found = Path(__file__).resolve().parents[2], hashlib.sha256()
    sources = [path for name in SOURCES for path in sorted((top / name).rglob("*.py"))]
    models = sorted(path for path in models_dir().rglob("*") if path.suffix in (".xml", ".toml"))
    for path in [*sources, *models]:
        found.update(path.name.encode())
        found.update(path.read_bytes())
    return found.hexdigest()


def run_key(options: Mapping[str, Any]) -> str:
    """Sixteen digits that stand for options, code, models and versions."""
    versions = {name: version_of(name) for name in PACKAGES}
    words = json.dumps([dict(options), versions, code_digest()], sort_keys=True, default=str)
    return hashlib.sha256(words.encode()).hexdigest()[:16]
