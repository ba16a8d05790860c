# /// script
# dependencies = []
# ///
"""Several environments at once, three ways: one after the other, in processes, in threads (ours)."""

import gymnasium
import numpy as np

TASK = {"jump_height": (0.04, 0.06), "randomization": "disturbed", "early_end": True}

if __name__ == "__main__":  # the processes import this file
    courses = {}
    for mode in ("sync", "async", "vector_entry_point"):
        envs = gymnasium.make_vec(
            "icub_jump_env:ICubJump-v1", num_envs=2, vectorization_mode=mode, **TASK
        )
        envs = gymnasium.wrappers.vector.RecordEpisodeStatistics(envs)
        envs.action_space.seed(0)
        seen = [envs.reset(seed=0)[0]]
        for _ in range(300):
            observations, rewards, *_ = envs.step(envs.action_space.sample())
            seen += [observations, rewards]
        envs.close()
        courses[mode] = np.concatenate([each.ravel() for each in seen])
    assert all(np.array_equal(course, courses["sync"]) for course in courses.values())
    print("300 steps of 2 environments: sync, async and threads agree bit for bit")
