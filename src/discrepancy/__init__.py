"""What a simulation gets wrong: residuals, causes, evidence, extended model, gain."""
