# /// script
# dependencies = []
# ///
"""Several environments at once, three ways: one after the other, in processes, in threads (ours)."""

import gymnasium
import numpy as np

TASK = {"jump_height": (0.04, 0.06), "randomization": "disturbed", "early_end": True}

if __name__ == "__main__":  # the processes import this file
    returns = {}
    for mode in ("sync", "async", "vector_entry_point"):
        envs = gymnasium.make_vec(
            "icub_jump_env:ICubJump-v1", num_envs=2, vectorization_mode=mode, **TASK
        )
        envs = gymnasium.wrappers.vector.RecordEpisodeStatistics(envs)
        envs.reset(seed=0)
        actions = np.zeros(envs.action_space.shape, np.float32)
        total = np.zeros(2)
        for _ in range(100):
            total += envs.step(actions)[1]
        envs.close()
        returns[mode] = total
    assert all(np.array_equal(total, returns["sync"]) for total in returns.values())
    print("100 steps of 2 environments; sync, async and threads pay the same rewards, bit for bit")
