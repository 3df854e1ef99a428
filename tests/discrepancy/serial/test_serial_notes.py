"""What a diagnosis says of its logs, once."""

from __future__ import annotations

from types import SimpleNamespace

from discrepancy.serial.diagnosis import notes_of


def log(name: str, *notes: str) -> SimpleNamespace:
    return SimpleNamespace(name=name, notes=notes)


def test_notes_that_differ_in_numbers_are_told_once():
    logs = [
        log("monday", "Stamps are uneven (0.0052 to 0.006 s apart).", "3 rows repeat."),
        log("tuesday", "Stamps are uneven (5.1e-03 to 0.00607 s apart)."),
        log("friday"),
        log("sunday", "Stamps are uneven (0.003 to 0.004 s apart)."),
    ]
    assert list(notes_of(logs)) == [
        "monday: Stamps are uneven (0.0052 to 0.006 s apart). "
        "So it is, with other numbers, in 2 more parts of the logs.",
        "monday: 3 rows repeat.",
    ]


def test_no_logs_have_no_notes():
    assert list(notes_of([])) == []
    assert list(notes_of([log("monday")])) == []
