"""A diagnosis' part of a report."""
