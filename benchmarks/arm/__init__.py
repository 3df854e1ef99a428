"""Effects hidden in a simulated seven-axis arm, and what the diagnosis makes of its logs."""
