"""Jump metrics from the true state; independent of the simulator and environment."""
