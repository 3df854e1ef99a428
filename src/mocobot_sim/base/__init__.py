"""The mecanum base: rollers on the floor, wheel speeds, odometry and path following."""
