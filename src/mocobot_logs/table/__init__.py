"""Tables: CSV, NPZ, MATLAB, Parquet, LeRobot."""
