"""Shapes of causes: numbers that change their columns, such as a pendulum's length or when a push acted."""
