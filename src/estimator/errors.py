"""Errors that the user can act on."""


class InputError(ValueError):
    """Bad input from the user: one sentence that names the file, the field, the value and what is allowed."""


class RepeatedRowsError(InputError):
    """A recording in which rows repeat the one before."""
