"""A diagnosis as text, JSON, plots and files."""
