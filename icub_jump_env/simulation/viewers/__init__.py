"""Screens that show a running simulation: MuJoCo's window, and a page in the browser."""
