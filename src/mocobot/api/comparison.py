"""Compare two results."""

from dataclasses import dataclass
from pathlib import Path

from estimator.files import holds, whole_folder
from mocobot.api.public import public
from mocobot.comparison import comparison as below
from mocobot.comparison.compare import Written
from mocobot.comparison.compare import compare as compare_below
from mocobot.comparison.text import format_comparison, write_into
from mocobot.files.targets import check_folder


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(below.Comparison):
    """What two results of one kind say differently, printable, and a folder of files.

    The attributes are those of ``mocobot.comparison.comparison.Comparison``.
    """

    def __str__(self) -> str:
        """The text report."""
        return format_comparison(self)

    def __repr__(self) -> str:
        """One line."""
        groups = f"{len(self.changed_groups)} of {len(self.groups)} groups changed"
        return f"<Comparison of two results, {self.kind}: {groups}>"

    def write(self, folder: Path | str) -> None:
        """Write JSON, text and a picture; an earlier comparison is replaced.

        Raises:
            InputError: the folder holds something else, or cannot be written.
        """
        check_folder(Path(folder), [], holds("comparison"), "an earlier comparison", force=True)
        with whole_folder(Path(folder), "comparison") as whole:
            write_into(whole, self)


def compare(a: Path | str | Written, b: Path | str | Written) -> Comparison:
    """Compare two estimates, calibrations or diagnoses: what changed beyond its errors.

    Args:
        a, b: results of ``estimate``, ``calibrate`` or ``diagnose``, both of the same; or their files or folders.

    Raises:
        InputError: one cannot be read, they are of different kinds, or of different numbers of robots.
    """
    return public(Comparison, compare_below(a, b))
