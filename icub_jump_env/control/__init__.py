"""Controllers: QP, velocity (eq. 3) and torque controller (eq. 6), minimum jerk, phases of the jump."""
