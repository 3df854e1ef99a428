"""The small engine: one linear problem in the frequency domain, causes as groups of columns, exact evidence."""
