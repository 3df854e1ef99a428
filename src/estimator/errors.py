"""Errors that the user can correct."""


class InputError(ValueError):
    """Invalid user input: one sentence with the file, the field, the value and the allowed range."""


class RepeatedRowsError(InputError):
    """A recording in which rows repeat the row before."""
