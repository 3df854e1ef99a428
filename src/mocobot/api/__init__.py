"""Implementation of the Python interface; import its names from ``mocobot`` (docs/api.md)."""
