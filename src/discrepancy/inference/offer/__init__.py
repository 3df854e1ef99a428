"""Causes that could be added to a hypothesis, in their best shapes."""
