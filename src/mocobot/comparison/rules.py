"""Constants of a comparison, each with where it comes from."""

LEVEL = 0.01
"""Probability that two results of the same truth are said to differ anywhere. Chosen: one false alarm in a hundred; it
is shared out evenly among the groups that are tested (Bonferroni)."""
TOGETHER = 0.9
"""Correlation from which on two errors are said to move together. Chosen: four fifths of the variance are then
common."""
RANK = 1e-10
"""Least share of the largest eigenvalue of a correlation matrix that counts as known. Derived: eigenvalues of double
precision are wrong by 1e-16 times the size, and files keep 16 digits; six orders above are left."""
EQUAL = 1e-9
"""Difference, relative to the values, that is none where errors are zero. Derived: numbers of degrees and matrices go
through files with a dozen operations of 1e-16 each."""
