"""A tiny environment in which things go wrong; importable in workers, and without torch."""

import os
import signal
import sys
import time

import gymnasium
import numpy as np
from gymnasium import spaces


class TroubledEnv(gymnasium.Env):
    """A drifting point to be kept at zero, until the trouble comes in an episode's third step."""

    observation_space = spaces.Box(-np.inf, np.inf, (2,), np.float32)
    action_space = spaces.Box(-1, 1, (1,), np.float32)

    def __init__(self, trouble="none"):
        self.trouble = trouble
        if trouble == "build":
            raise ValueError("no such\nworld")

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state = self.np_random.normal(size=2).astype(np.float32)
        self.steps = 0
        if self.trouble == "reset":
            raise RuntimeError("cannot\nreset")
        return self.state.copy(), {"options": options}

    def step(self, action):
        self.steps += 1
        noise = self.np_random.normal(0, 0.1, 2)
        self.state = (self.state + noise + 0.3 * action).astype(np.float32)
        if self.steps == 3:
            match self.trouble:
                case "exit":
                    os._exit(7)
                case "sleep":
                    time.sleep(1000)
                case "error":
                    raise ZeroDivisionError("divided\nby zero")
        truncated, terminated = self.steps >= 20, bool(abs(self.state[0]) > 3)
        return self.state.copy(), -float(self.state @ self.state), terminated, truncated, {}

    def surroundings(self):
        blocked = signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())
        return "torch" in sys.modules, os.environ["OPENBLAS_NUM_THREADS"], blocked
