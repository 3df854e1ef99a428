"""The mecanum base: rollers on the floor, wheel speeds, odometry, and paths that bases follow."""
