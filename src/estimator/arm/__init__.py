"""Model of one arm: design, kinematics, dynamics."""
