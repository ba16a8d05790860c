"""The jump benchmark: a fixed set of jumps for any policy or controller, and its results."""
