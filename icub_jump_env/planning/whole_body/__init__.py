"""Whole-body plans: joint trajectories optimised within the robot's limits.

Made with CasADi (``sagittal``, ``launch``, ``landing``, ``build``), kept as files and followed
without it (``family``, ``plan``).
"""
