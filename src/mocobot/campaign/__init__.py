"""Blind campaigns: hide effects in simulated teams, diagnose, and count what was found, missed and invented."""
