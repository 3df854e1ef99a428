"""The paper's experiment: simulated trials of its payloads, estimates, and comparison with its Tables II-V."""
