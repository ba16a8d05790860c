# /// script
# dependencies = ["torchrl"]
# ///
"""The environment in TorchRL: its specs are checked, and a random policy collects steps."""

import torch
from torchrl.collectors import Collector
from torchrl.envs import GymEnv, RewardSum, StepCounter, TransformedEnv
from torchrl.envs.utils import check_env_specs

TASK = {"jump_height": (0.04, 0.06), "randomization": "disturbed", "early_end": True}

if __name__ == "__main__":
    env = TransformedEnv(GymEnv("icub_jump_env:ICubJump-v1", **TASK), RewardSum())
    env.append_transform(StepCounter())
    torch.manual_seed(0)
    env.set_seed(0)
    check_env_specs(env)
    collector = Collector(env, policy=None, frames_per_batch=256, total_frames=1024)
    episodes = sum(int(batch["next", "done"].sum()) for batch in collector)
    collector.shutdown()
    print(f"1024 steps collected, {episodes} episodes ended")
