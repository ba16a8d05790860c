"""Plans of a jump: what the controllers shall track, and how a residual moves it."""
