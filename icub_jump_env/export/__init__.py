"""Policies, plans and jumps in formats that other programs read."""
