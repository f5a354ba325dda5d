"""From a target to joint angles: gaze, path and inverse kinematics."""
