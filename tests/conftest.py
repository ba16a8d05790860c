"""Fixtures shared by all tests."""

import os

# One thread: the matrices are small, and results must not depend on the machine's load.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import io
import shutil
import signal

import gymnasium
import numpy as np
import pytest
from hypothesis import settings
from rich.console import Console

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import Episode, make_env, run_episode, traced
from icub_jump_env.evaluation.modes import nominal as nominal_mode

# Where tests run in the background, Ctrl-C is ignored, also by the programs that they start.
signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("ci", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("full", settings.get_profile("ci"), max_examples=10_000)
settings.load_profile("ci")


def pytest_addoption(parser):
    parser.addoption("--full", action="store_true", help="many cases of each fault, for hours")


def pytest_configure(config):
    config.addinivalue_line("markers", "fault(name): what is tried; tests/faults/count.py counts")
    if config.getoption("full"):
        settings.load_profile("full")


@pytest.fixture
def only_full(request):
    """Skip what takes long, or needs a process that does nothing else."""
    if not request.config.getoption("full"):
        pytest.skip("with --full")


@pytest.fixture
def many(request, record_property):
    """How many cases to try: quickly, and with --full."""

    def choose(quick: int, full: int) -> int:
        count = full if request.config.getoption("full") else quick
        record_property("cases", count)
        return count

    return choose


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20190425)


@pytest.fixture
def quiet() -> Console:
    """A console that nobody reads."""
    return Console(file=io.StringIO())


@pytest.fixture(autouse=True)
def in_temporary_folder(tmp_path, monkeypatch):
    """Evaluations keep their episodes in the working folder."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="session", autouse=True)
def few_repetitions():
    """The nominal mode repeats its jumps less often."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(nominal_mode, "REPETITIONS", 2)
        yield


ZERO = np.zeros(3, dtype=np.float32)

HARD = {
    "randomization": "hard",
    "sensors": "realistic",
    "actuators": "realistic",
    "command_delay": 1,
    "stand_time": 0.1,
}
"""Every variation at once."""


@pytest.fixture
def env():
    env = gymnasium.make("ICubJump-v0", stand_time=0.3)
    yield env
    env.close()


def rollout(env, actions=None, seed=0, options=None):
    """All observations, rewards and the last info of an episode."""
    rng = np.random.default_rng(seed)
    obs, _ = env.reset(seed=seed, options=options)
    observations, rewards, terminated = [obs], [], False
    while not terminated:
        action = ZERO if actions is None else actions(rng)
        obs, reward, terminated, truncated, info = env.step(action)
        assert not truncated
        observations.append(obs)
        rewards.append(reward)
    return np.array(observations), np.array(rewards), info


def random_action(rng):
    return rng.uniform(-1, 1, 3).astype(np.float32)


def jump(**config) -> Episode:
    env = make_env(JumpConfig.of(**config))
    episode = run_episode(env, seed=0)
    env.close()
    return episode


@pytest.fixture(scope="session")
def nominal() -> Episode:
    """The nominal jump with a snapshot at each control tick."""
    env = make_env(traced(JumpConfig()))
    episode = run_episode(env, seed=0, trace=True)
    env.close()
    return episode


@pytest.fixture(scope="session")
def ablated() -> Episode:
    """The same without the momentum constraint."""
    return jump(momentum_control=False)


CHROMIUM, CHROMEDRIVER = "/usr/bin/chromium", "/usr/bin/chromedriver"


@pytest.fixture(scope="module")
def plain_model():
    """Without meshes, which take their time."""
    env = make_env(JumpConfig())
    yield env.model
    env.close()


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    webdriver = pytest.importorskip("selenium.webdriver")
    for program in (CHROMIUM, CHROMEDRIVER):
        if shutil.which(program) is None:
            pytest.skip(f"no {program}")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for switch in (
        "headless=new", "no-sandbox", "disable-gpu", "disable-dev-shm-usage", "no-first-run",
        "disable-background-networking", "disable-component-update", "disable-sync",
        f"user-data-dir={tmp_path_factory.mktemp('chromium')}",
    ):  # fmt: skip
        options.add_argument(f"--{switch}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    service = webdriver.ChromeService(CHROMEDRIVER)
    driver = webdriver.Chrome(options=options, service=service)
    yield driver
    driver.quit()
