"""Read and write measured logs: ROS 2 bags, tables and arrays, resampled onto one clock into a recording."""
