"""The arm: design, kinematics, dynamics."""
