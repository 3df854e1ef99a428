"""Diagnosis of a team of mobile robots that carries a payload."""
