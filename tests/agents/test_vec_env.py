"""Environments in workers and in threads: the results of Stable-Baselines3, errors, clean ends."""

import contextlib
import functools
import os
import signal
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import psutil
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor
from tiny_run import children
from troubled_env import TroubledEnv

from agents.environment import LaunchEnv
from agents.vec_env import JumpVecEnv, ThreadVecEnv
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError, InvalidValueError
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.policy import BASELINE
from icub_jump_env.workers import WorkerError

ACTION = np.zeros((2, 1), np.float32)
CONFIG = JumpConfig.of(stand_time=0.0)


def troubled(*troubles):
    return [functools.partial(TroubledEnv, trouble) for trouble in troubles]


@pytest.fixture
def start():
    """Starts a JumpVecEnv and sees to it that nothing remains of it."""
    started = []

    def start_workers(*troubles):
        started.append(JumpVecEnv(troubled(*troubles)))
        return started[-1]

    before = children()
    yield start_workers
    for env in started:
        env.close()
    assert children() == before


def step_until_trouble(env):
    env.reset()
    for _ in range(3):
        env.step(ACTION)


def test_the_results_are_those_of_stable_baselines3(start, rng):
    env, reference = start("none", "none"), DummyVecEnv(troubled("none", "none"))
    observation = env.reset_all([5, 2**32 - 1])
    reference._seeds = [5, 2**32 - 1]
    assert np.array_equal(observation, reference.reset())
    assert list(env.reset_infos) == reference.reset_infos
    dones = 0
    for _ in range(50):
        action = rng.uniform(-1, 1, (2, 1)).astype(np.float32)
        result, expected = env.step(action), reference.step(action)
        for got, wanted in zip(result[:3], expected[:3], strict=True):
            np.testing.assert_array_equal(got, wanted)
        np.testing.assert_equal(list(result[3]), list(expected[3]))
        dones += result[2].sum()
    assert dones > 2


def test_the_workers_surroundings(start, monkeypatch):
    """No torch unless the environment imports it, one thread, and Ctrl-C is not for them."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    env = start("none")
    assert env.env_method("surroundings") == [(False, "1", True)]
    assert "OPENBLAS_NUM_THREADS" not in os.environ
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_a_wrong_number_of_seeds_is_refused(start):
    with pytest.raises(
        InvalidValueError, match=r"^seeds=\[1, 2\] is not allowed: expected 1, one each$"
    ):
        start("none").reset_all([1, 2])


@pytest.mark.parametrize(
    ("trouble", "message"),
    [
        ("exit", r"^worker 1 died \(exit code 7\)$"),
        ("error", r"^worker 1 failed: ZeroDivisionError: divided by zero$"),
        ("reset", r"^worker 1 failed: RuntimeError: cannot reset$"),
    ],
)
def test_trouble_in_a_worker_is_named(start, capfd, trouble, message):
    env = start("none", trouble)
    with pytest.raises(WorkerError, match=message):
        step_until_trouble(env)
    with pytest.raises(WorkerError, match=r"^worker 1 died \(exit code [07]\)$"):
        step_until_trouble(env)
    assert capfd.readouterr() == ("", "")


def test_an_environment_that_cannot_be_built_is_named(capfd):
    before = children()
    with pytest.raises(WorkerError, match=r"^worker 1 failed: ValueError: no such world$"):
        JumpVecEnv(troubled("none", "build"))
    assert children() == before
    assert capfd.readouterr() == ("", "")


def test_a_worker_that_failed_unnoticed_is_named_with_its_reason(start):
    worker = start("reset").remotes[0]
    worker.send(("reset", (None, None)))
    worker.process.join()
    with pytest.raises(WorkerError, match=r"^worker 0 failed: RuntimeError: cannot reset$"):
        worker.send(("reset", (None, None)))


def test_an_unknown_request_is_named(start):
    with pytest.raises(WorkerError, match=r"^worker 0 failed: NotImplementedError: .*'has_attr'$"):
        start("none").has_attr("anything")


def test_an_evaluation_deals_its_episodes_out():
    env = JumpVecEnv([functools.partial(LaunchEnv, CONFIG, ("time",), ("forward",))] * 2)
    with contextlib.closing(env):
        episodes = env.evaluate(BASELINE, range(7, 10))
    plain = make_env(CONFIG)
    assert episodes == [run_episode(plain, seed) for seed in (7, 8, 9)]


def test_a_busy_worker_is_ended(start):
    env = start("none", "sleep")
    env.reset()
    for _ in range(2):
        env.step(ACTION)
    env.step_async(ACTION)
    env.close()
    assert [worker.process.exitcode for worker in env.remotes] == [-signal.SIGKILL] * 2


PROGRAM = """
import contextlib
import functools
import sys

if __name__ == "__main__":
    import numpy as np

    from agents.vec_env import JumpVecEnv, ThreadVecEnv
    from troubled_env import TroubledEnv

    try:
        print("starting", flush=True)
        with contextlib.closing(JumpVecEnv([functools.partial(TroubledEnv)] * 2)) as env:
            env.reset()
            print("running", flush=True)
            while True:
                env.step(np.zeros((2, 1), np.float32))
    except KeyboardInterrupt:
        print("interrupted")
"""


@pytest.fixture(params=["starting", "running"])
def program(tmp_path, request):
    script = tmp_path / "program.py"
    script.write_text(PROGRAM)
    folders = Path(__file__).parents[2], Path(__file__).parent
    with subprocess.Popen(
        [sys.executable, str(script)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, folders))},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as program:
        for line in program.stdout:
            if line == f"{request.param}\n":
                break
        yield program
        program.kill()


def test_an_interrupt_leaves_no_process_and_no_noise(program):
    """Also where it comes while workers start."""
    started = psutil.Process(program.pid).children(recursive=True)
    os.killpg(program.pid, signal.SIGINT)
    output, errors = program.communicate(timeout=60)
    assert output.endswith("interrupted\n")
    assert errors == ""
    assert not psutil.wait_procs(started, timeout=60)[1]


TASK = {"randomization": "hard", "stand_time": 0.0}


class TestThreads:
    def threads(self, num_envs=3):
        return ThreadVecEnv(
            gymnasium.make_vec("ICubJump-v0", num_envs=num_envs, autoreset_mode="SameStep", **TASK)
        )

    def test_the_results_are_those_of_stable_baselines3(self, rng):
        env = self.threads()
        reference = DummyVecEnv([functools.partial(gymnasium.make, "ICubJump-v0", **TASK)] * 3)
        for vector in (env, reference):
            vector.seed(5)
        assert np.array_equal(env.reset(), reference.reset())
        assert env.reset_infos == reference.reset_infos
        ends = 0
        for _ in range(160):
            action = rng.uniform(-1, 1, (3, 3)).astype(np.float32)
            result, expected = env.step(action), reference.step(action)
            np.testing.assert_equal(result, expected)
            ends += result[2].sum()
        assert ends >= 3
        assert env.reset_infos == reference.reset_infos
        env.close()

    def test_it_learns(self):
        env = VecMonitor(self.threads(2))
        model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=1, device="cpu")
        model.learn(256)
        assert model.num_timesteps == 256
        assert len(model.ep_info_buffer) >= 1
        env.close()

    def test_it_wants_resets_in_the_last_step(self):
        with pytest.raises(ConfigError, match="autoreset_mode"):
            ThreadVecEnv(gymnasium.make_vec("ICubJump-v0", num_envs=1))

    def test_a_plain_loop_learns(self):
        """As CleanRL has it: tensors, no step that was a reset, one policy gradient."""
        envs = gymnasium.make_vec("ICubJump-v0", num_envs=2, **TASK)
        envs = gymnasium.wrappers.vector.RecordEpisodeStatistics(envs)
        torch.manual_seed(0)
        policy = torch.nn.Linear(*envs.single_observation_space.shape, 3)
        before = policy.weight.detach().clone()
        observation, lengths = torch.tensor(envs.reset(seed=0)[0]), []
        log_probabilities, returns, over = [], torch.zeros(2), np.zeros(2, bool)
        for _ in range(160):
            distribution = torch.distributions.Normal(policy(observation), 0.1)
            action = distribution.sample()
            playing = torch.tensor(~over)
            observed, reward, terminated, truncated, info = envs.step(action.numpy())
            log_probabilities.append(distribution.log_prob(action).sum(1) * playing)
            returns += torch.tensor(reward)
            observation, over = torch.tensor(observed), terminated | truncated
            lengths += info["episode"]["l"][over].tolist() if over.any() else []
        (-(torch.stack(log_probabilities).sum(0) * returns).mean()).backward()
        torch.optim.SGD(policy.parameters(), 1e-3).step()
        assert len(lengths) >= 2
        assert min(lengths) > 50
        assert torch.isfinite(policy.weight).all()
        assert not torch.equal(policy.weight, before)
        envs.close()
