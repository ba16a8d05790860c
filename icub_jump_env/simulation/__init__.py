"""The simulated robot: physics, joint servos, sensors, ground truth, pictures."""
