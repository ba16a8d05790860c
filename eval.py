"""Evaluate the jump: ``python eval.py --help``."""

import sys

from icub_jump_env.evaluation.cli import evaluate

if __name__ == "__main__":
    evaluate(sys.argv[1:])
