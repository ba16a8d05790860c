"""Running episodes: one, many, side by side, logged as they come."""
