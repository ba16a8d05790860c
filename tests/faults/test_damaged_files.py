"""Files damaged at random: each is refused with its name, or says what it said before."""

import shutil

import numpy as np
import pytest

from icub_jump_env.benchmark.cases import CASES, EPISODES
from icub_jump_env.benchmark.results import Result, Score
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ICubJumpError, PolicyMismatchError
from icub_jump_env.evaluation.episodes.log import EpisodeLog
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.evaluation.statistics.summary import Rate
from icub_jump_env.planning.whole_body.family import SHIPPED as PLANS
from icub_jump_env.planning.whole_body.family import load_family
from icub_jump_env.policy.saving import SHIPPED as POLICIES
from icub_jump_env.policy.saving import load_policy

HEADER = {"config": {}, "episodes": 3}


def policy(path):
    """Its actions."""
    act = load_policy(path.with_suffix(".safetensors"))
    return act(np.linspace(-1.0, 1.0, act.card.config.layout.size, dtype=np.float32)).tobytes()


def plans(path):
    """Joint angles of a plan."""
    return load_family(path.with_suffix(".npz")).position.tobytes()


def log(path):
    """Its episodes, those that are left."""
    return EpisodeLog(path, HEADER, resume=True).episodes


def result(path):
    """Its score."""
    return Result.read(path).total


def written_log(folder):
    found = EpisodeLog(folder / "log.jsonl", HEADER, resume=False)
    env = make_env(JumpConfig.of(stand_time=0.0))
    for seed in range(3):
        found.append(run_episode(env, seed))
    return found.path


def written_result(folder):
    score = Score(Rate(EPISODES - 10, EPISODES), 0.05, 0.02, {"fell": 10})
    path = folder / "result.json"
    Result("mine", dict.fromkeys(CASES, score), {}).write(path)
    return path


def copied(source):
    def copy(folder):
        for suffix in (".json", source.suffix):
            shutil.copy(source.with_suffix(suffix), folder)
        return folder / source.name

    return copy


FILES = {
    "policy": (copied(POLICIES / "disturbed-velocity.safetensors"), policy),
    "card": (copied(POLICIES / "disturbed-velocity.safetensors"), policy),
    "plans": (copied(PLANS / "iCubGenova04-velocity.npz"), plans),
    "log": (written_log, log),
    "result": (written_result, result),
}


def damage(content, rng):
    """Cut off, changed, overwritten, or with something that does not belong there."""
    start, length = rng.integers(len(content)), rng.integers(1, 200)
    kind = rng.integers(5)
    if kind == 0:
        return content[:start]
    if kind == 1:
        changed = bytearray(content)
        changed[start] ^= 1 << rng.integers(8)
        return bytes(changed)
    middle = (rng.bytes(length), b"", content[start : start + length] * 2)[kind - 2]
    return content[:start] + middle + content[start + length :]


@pytest.mark.fault("damaged files")
@pytest.mark.parametrize("kind", FILES)
def test_a_damaged_file_is_refused_or_says_the_same(many, rng, tmp_path, kind):
    write, read = FILES[kind]
    path = write(tmp_path)
    said = read(path)
    if kind == "card":
        path = path.with_suffix(".json")
    content, refusals = path.read_bytes(), []
    for _ in range(many(100, 5_000)):
        path.write_bytes(damage(content, rng))
        try:
            found = read(path)
        except PolicyMismatchError:  # which says what differs
            continue
        except ICubJumpError as error:
            refusals.append(str(error))
            continue
        if kind == "log":
            assert found.items() <= said.items()
        elif kind != "card":  # whose description nothing seals
            assert found == said
    assert refusals
    assert all(path.stem in refusal for refusal in refusals)
