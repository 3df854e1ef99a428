"""Blind campaigns: hide effects in simulated teams, diagnose them, and count hits, misses and false alarms."""
