"""What is said of text tables that are nearly right: the sentence names what would make them so."""

from __future__ import annotations

from pathlib import Path

import pytest

from estimator.errors import InputError
from log_files import assert_same, read_log, refused, write_text
from mocobot_logs.draft import draft_of
from recordings import small_recording

RECORDING = small_recording(rows=60)


def lines(path: Path, **how: str) -> list[str]:
    return write_text(path, RECORDING.columns(), **how).read_text().splitlines()


def with_times(path: Path, times: list[str]) -> Path:
    first, *rows = lines(path)
    cut = [f"{time},{row.partition(',')[2]}" for time, row in zip(times, rows, strict=True)]
    path.write_text("\n".join([first, *cut]))
    return path


def test_columns_of_fixed_width(tmp_path: Path) -> None:
    """Numbers with blanks before and behind them, time among them."""
    first, *rows = lines(tmp_path / "log.csv")
    padded = [",".join(f"  {cell} " for cell in row.split(",")) for row in rows]
    (tmp_path / "log.csv").write_text("\n".join([first, *padded]))
    assert_same(read_log(tmp_path / "log.csv"), RECORDING)


def test_a_decimal_comma(tmp_path: Path) -> None:
    lines(tmp_path / "log.csv", delimiter=";", decimal=",")
    assert """it must hold numbers (for a decimal comma, decimal = "," in the map's [csv])""" in refused(
        tmp_path / "log.csv"
    )


@pytest.mark.parametrize("form", ["01.03.2026 12:00:{:05.2f}", "12:00:{:05.2f}"])
def test_dates_that_are_not_of_iso(tmp_path: Path, form: str) -> None:
    """They had been called numbers where the map says dates, and the draft had said dates."""
    path = with_times(tmp_path / "log.csv", [form.format(t) for t in RECORDING.time])
    assert "in row 0; a time must be a number or a date of ISO 8601, such as 2026-" in refused(path)
    assert 'unit = "s"  # doubtful: its values cannot be read' in draft_of(path).text
    iso = draft_of(path).text.replace('unit = "s"', 'unit = "iso"')
    (tmp_path / "my.toml").write_text(iso)
    from mocobot_logs.maps import read_map

    assert "in row 0; a time must be a date like 2026-" in refused(path, read_map(tmp_path / "my.toml"))


def test_a_draft_of_a_file_that_is_cut_off(tmp_path: Path) -> None:
    """It had guessed units of values that it could not read."""
    path = tmp_path / "log.csv"
    content = "\n".join(lines(path))
    path.write_text(content[: len(content) // 2 + 100].rpartition(",")[0])
    with pytest.raises(InputError, match=r"cells? in line \d+; every row must have 37, like the header"):
        draft_of(path)


def test_a_draft_of_a_file_with_a_title(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["Lab log 12", "Operator: me", *lines(path)]))
    with pytest.raises(InputError, match="line 2; every row must have 3, like the header"):
        draft_of(path)
