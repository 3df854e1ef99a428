"""Robots of many shapes for the engine of evidence: hide, diagnose, score."""
