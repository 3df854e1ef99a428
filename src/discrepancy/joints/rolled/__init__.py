"""The model and the extended model simulated, and held against the logs."""
