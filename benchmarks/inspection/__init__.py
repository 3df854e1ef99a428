"""Made-up joint logs for `benchmarks/inspect_joints.py`."""
