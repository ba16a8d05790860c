"""What runs in a worker process: one environment that answers requests.

Kept apart from :mod:`agents.vec_env` so that a worker imports what its environment needs,
and not torch.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import Any

import gymnasium

Env = gymnasium.Env[Any, Any]


def run_worker(connection: Connection, make_env: Callable[[], Env]) -> None:
    """Answer requests until the other end of the connection is closed, or its process dead.

    Each answer is a pair: None and the result, or what went wrong, in one line, and None;
    the worker ends after such a failure.

    Args:
        connection: Where requests of Stable-Baselines3's ``SubprocVecEnv`` come from.
        make_env: Builds the environment.
    """
    try:
        with contextlib.closing(make_env()) as env:
            for command, data in _requests(connection):
                connection.send((None, _answer(env, command, data)))
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        with contextlib.suppress(OSError):  # nobody listens any more
            connection.send((reason, None))


def _requests(connection: Connection) -> Iterator[tuple[str, Any]]:
    with contextlib.suppress(EOFError, ConnectionError):
        while True:
            yield connection.recv()


def _answer(env: Env, command: str, data: Any) -> Any:
    match command:
        case "step":
            return _step(env, data)
        case "reset":
            seed, options = data
            return env.reset(seed=seed, options=options or None)
        case "get_spaces":
            return env.observation_space, env.action_space
        case "get_attr":
            return env.get_wrapper_attr(data)
        case "env_method":
            name, args, kwargs = data
            return env.get_wrapper_attr(name)(*args, **kwargs)
    raise NotImplementedError(f"a worker does not know {command!r}")


def _step(env: Env, action: Any) -> tuple[Any, ...]:
    """One step, and the next reset if it ends the episode, as Stable-Baselines3 wants them."""
    observation, reward, terminated, truncated, info = env.step(action)
    done = terminated or truncated
    info["TimeLimit.truncated"] = truncated and not terminated
    reset_info: dict[str, Any] = {}
    if done:
        info["terminal_observation"] = observation
        observation, reset_info = env.reset()
    return observation, reward, done, info, reset_info
