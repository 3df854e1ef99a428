"""What a look at a log offers, whatever the log is of: findings, one line, text, JSON."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

from estimator.files import write_json
from mocobot_inspect.findings import Finding


class Look:
    """Printable, in a terminal and as JSON; a class of looks says by which functions, each of which gets the look."""

    name: str
    _findings: ClassVar[Callable[..., list[Finding]]]
    _ready_line: ClassVar[Callable[..., str]]
    _text: ClassVar[Callable[..., str]]
    _dict: ClassVar[Callable[..., dict[str, Any]]]

    @property
    def findings(self) -> list[Finding]:
        """All that is wrong: ``topic`` and ``sentence`` each."""
        return type(self)._findings(self)

    @property
    def ready_for(self) -> str:
        """What the log can be used for, one line."""
        return type(self)._ready_line(self)

    def __str__(self) -> str:
        """The text report."""
        return type(self)._text(self)

    def __repr__(self) -> str:
        """One line."""
        return f"<{type(self).__name__} of {self.name}: {self.ready_for}>"

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON with units in the keys."""
        return type(self)._dict(self)

    def write(self, path: Path | str) -> None:
        """Write it as JSON.

        Raises:
            InputError: the file cannot be written.
        """
        write_json(Path(path), self.to_dict())
