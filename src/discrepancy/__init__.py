"""Diagnose what a simulation gets wrong: residuals, causes, evidence, extended model and gain."""
