"""Quadratic programs: the problem, its solvers, and the check outside of them."""
