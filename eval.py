"""Evaluate the jump: ``python eval.py --help``."""

import sys

if __name__ == "__main__":
    try:
        from icub_jump_env.evaluation.cli import evaluate
    except KeyboardInterrupt:  # while Python still imports
        sys.exit(130)
    evaluate(sys.argv[1:])
