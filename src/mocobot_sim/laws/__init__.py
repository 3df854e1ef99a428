"""Formulas that act in a trial: what the effect ``law`` is made of."""
