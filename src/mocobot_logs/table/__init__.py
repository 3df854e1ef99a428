"""Tables: CSV, NPZ, Parquet, LeRobot."""
