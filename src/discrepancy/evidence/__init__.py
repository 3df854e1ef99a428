"""Search the likeliest set of causes of a linear problem in the frequency domain, by exact evidence."""
