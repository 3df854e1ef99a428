"""Read and write measured logs: ROS 2 bags, tables and arrays, resampled onto one clock into a recording.

What cannot be read, or does not fit its map, raises ``InputError``: one sentence with file, place and value.
"""
