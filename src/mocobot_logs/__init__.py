"""Measured logs in and out: ROS 2 bags, tables and arrays, brought onto one clock and into a recording."""
