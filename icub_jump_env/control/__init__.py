"""Velocity (eq. 3) and torque controller (eq. 6), flight and landing, the phases of a jump."""
