"""From motions and wrenches to grasps and inertial parameters."""
