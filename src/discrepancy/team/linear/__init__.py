"""Linearised trials of a team."""
