"""One HTML page from the files that a result folder holds: tables, plots, pictures and provenance, for a colleague."""
