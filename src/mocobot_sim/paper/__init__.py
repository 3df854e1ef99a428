"""The paper's experiment: trials of its payloads, estimates, and their scores beside its Tables II-V."""
