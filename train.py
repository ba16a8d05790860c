"""Train a residual on the CoM reference: ``python train.py --help``."""

import sys

if __name__ == "__main__":
    try:
        from agents.cli import run
    except KeyboardInterrupt:  # while Python still imports
        sys.exit(130)
    run(sys.argv[1:])
