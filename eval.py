"""Evaluate the jump: ``python eval.py --help``."""

import os
import sys

if __name__ == "__main__":
    # MuJoCo chooses its OpenGL when it is imported; without a display only EGL works.
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")

    from icub_jump_env.evaluation.cli import evaluate

    evaluate(sys.argv[1:])
