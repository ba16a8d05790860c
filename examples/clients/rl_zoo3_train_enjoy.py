# /// script
# dependencies = ["rl_zoo3", "requests"]  # enjoy imports requests, which rl_zoo3 does not install
# ///
"""Train with rl-zoo3, and let the trained policy act: its commands, as one would type them."""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

HYPERPARAMETERS = Path(__file__).parents[2] / "agents" / "hyperparameters" / "rl_zoo3_ppo.yml"
TRAIN = """
    --algo ppo --env ICubJump-v1 --gym-packages icub_jump_env
    --vec-env subproc
    --env-kwargs jump_height:(0.04,0.06) early_end:True randomization:'disturbed'
    --n-timesteps 2048 --eval-freq 1024 --eval-episodes 4 --seed 0
"""  # --env-kwargs are evaluated as Python
ENJOY = """
    --algo ppo --env ICubJump-v1 --gym-packages icub_jump_env
    --load-best --no-render --n-timesteps 600
"""

if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        for module, words, paths in (
            ("rl_zoo3.train", TRAIN, ["--conf-file", HYPERPARAMETERS, "--log-folder", folder]),
            ("rl_zoo3.enjoy", ENJOY, ["--folder", folder]),
        ):
            command = [sys.executable, "-m", module, *words.split(), *paths]
            subprocess.run(command, check=True)
        best = next(Path(folder).rglob("best_model.zip"))
        print(f"trained 2048 steps, kept {best.name}, which acted for 600 steps")
