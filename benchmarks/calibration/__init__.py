"""How good calibrations of simulated teams are, against the truth."""
