"""Evaluation: rollouts, the table against the paper, figures, video."""
