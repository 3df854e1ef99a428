"""What is held against each other: loops and balance of trials, and unloaded arms, in rows with their noise."""
