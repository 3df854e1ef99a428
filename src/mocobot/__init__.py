"""Command line of mocobot."""
