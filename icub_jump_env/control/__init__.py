"""Controllers: QP, velocity controller (eq. 3), minimum jerk, phases of the jump."""
