"""Inference: hypotheses about what is there, how likely they make the data, and the search for the likeliest."""
