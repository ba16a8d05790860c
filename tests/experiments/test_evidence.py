"""One command remakes runs, shipped policies, rivals and the picture, and nothing twice."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from tiny_run import ARGUMENTS, train, written

from agents import training
from agents.cli import asked
from agents.options import TrainOptions
from experiments import evidence, rivals
from experiments.evidence import EvidenceError, EvidenceOptions, remake, trainings
from experiments.shipped import REPOSITORY
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode
from icub_jump_env.policy import load_policy

SHIPPED, RUNS = Path("shipped"), Path("shipped/runs")


@pytest.fixture
def calls(monkeypatch):
    """Commands that were run; trainings take a second here."""
    made = []

    def run(*words):
        made.append(words)
        if words[0] == "train.py":
            assert train(monkeypatch, *words[1:]) == 0

    monkeypatch.setattr(evidence, "_run", run)
    for name, folder in {"REPOSITORY": Path(), "SHIPPED": SHIPPED, "RUNS": RUNS}.items():
        monkeypatch.setattr(evidence, name, folder)
    monkeypatch.setattr(evidence, "HEADLINE_SEEDS", range(2))
    monkeypatch.setattr(evidence, "CONTROLLERS", ("velocity",))
    monkeypatch.setattr(evidence, "ABLATIONS", {"forward": ("--axes", "forward")})
    monkeypatch.setattr(evidence, "ABLATION_SEEDS", range(1))
    monkeypatch.setattr(evidence, "DISTURBED", ())
    named = trainings()
    fast = (*ARGUMENTS, "--timesteps", "1", "--jobs", "1")
    tiny = {name: (*words, *fast) for name, words in named.items()}
    monkeypatch.setattr(evidence, "trainings", lambda: tiny)
    monkeypatch.setattr(evidence, "TEST", range(3000, 3002))
    monkeypatch.setattr(evidence, "FELT_TEST", range(3002, 3004))
    monkeypatch.setattr(rivals, "FORWARD", (0.0, 0.4))
    monkeypatch.setattr(rivals, "VERTICAL", (0.0,))
    monkeypatch.setattr(rivals, "_COMMANDS", 2)
    monkeypatch.setattr(rivals.best_constant, "__defaults__", (range(2),))
    monkeypatch.setattr(rivals.open_loop, "__defaults__", (range(2),))
    Path("docs/images").mkdir(parents=True)
    return made


def score(file):
    return load_policy(file).card.results["evaluation"]["score"]


def test_everything_is_made_and_nothing_twice(calls):
    remake(EvidenceOptions())
    names = [
        *("velocity-seed0", "velocity-seed1"),
        *("disturbed-velocity-seed0", "disturbed-velocity-seed1"),
        *("disturbed-velocity-plan-seed0", "disturbed-velocity-forward-seed0"),
    ]
    assert sorted(file.stem for file in RUNS.glob("*.safetensors")) == sorted(names)
    assert len(list(RUNS.glob("*.curve.json"))) == len(names)
    assert [words[0] for words in calls] == ["train.py"] * 6 + ["docs/update.py"]
    plan = load_policy(RUNS / "disturbed-velocity-plan-seed0.safetensors").card
    assert len(plan.inputs) == len(TrainOptions(inputs="command").input_names)
    assert all(Path("docs/images", f"learning{task}.png").exists() for task in ("", "_disturbed"))
    candidates = [RUNS / f"velocity-seed{seed}.safetensors" for seed in (0, 1)]
    best = load_policy(max(candidates, key=score))
    shipped = load_policy(SHIPPED / "velocity.safetensors")
    for name, tensor in best.policy.tensors().items():
        np.testing.assert_array_equal(shipped.policy.tensors()[name], tensor)
    test = shipped.card.results["test"]
    env = make_env(shipped.card.config)
    rises = [run_episode(env, s, shipped).jump["flight_height"] for s in range(3000, 3002)]
    assert (test["seeds"], test["mean_rise"]) == ((3000, 3002), pytest.approx(np.mean(rises)))
    for rival in ("constant", "open-loop"):
        card = load_policy(SHIPPED / f"velocity-{rival}.safetensors").card
        assert card.config == shipped.card.config
    felt = load_policy(SHIPPED / "disturbed-velocity.safetensors").card
    assert felt.results["test"]["seeds"] == (3002, 3004)
    assert felt.config == shipped.card.config  # which is not so outside of this test
    before = written(SHIPPED)
    Path(RUNS, "velocity-old-seed0.json").touch()  # of an ablation that is no more
    remake(EvidenceOptions())
    assert written(SHIPPED) == before
    assert [words[1] for words in calls[7:13]] == ["--resume"] * 6
    for file in SHIPPED.glob("*.*"):
        file.unlink()
    made = len(calls)
    remake(EvidenceOptions(only="rest"))
    assert written(SHIPPED) == before
    assert calls[made:] == [("docs/update.py",)]


def test_runs_of_other_options_or_code_are_not_taken_for_these(calls, monkeypatch):
    (name, words), *_ = evidence.trainings().items()
    monkeypatch.setattr(evidence, "trainings", lambda: {name: words})
    remake(EvidenceOptions(only="trainings"))
    assert not list(SHIPPED.glob("*.safetensors"))
    made = len(calls)
    with monkeypatch.context() as patch:
        patch.setattr(evidence, "trainings", lambda: {name: (*words, "--ppo.epochs", "2")})
        with pytest.raises(EvidenceError, match=f"{name} holds a run with other options"):
            remake(EvidenceOptions(only="trainings"))
    monkeypatch.setattr(training, "source", lambda: "0" * 16)
    with pytest.raises(EvidenceError, match=f"{name} holds a run of other code"):
        remake(EvidenceOptions(only="trainings"))
    assert len(calls) == made  # neither went on


def test_a_command_that_fails_ends_it_with_its_words():
    with pytest.raises(EvidenceError, match=r"failed: python -c 'raise SystemExit\(3\)'"):
        evidence._run("-c", "raise SystemExit(3)")


def test_every_kind_of_training_has_its_seeds(monkeypatch):
    monkeypatch.chdir(REPOSITORY)
    named = trainings()
    assert len(named) == 2 * (5 + 5 + 3) + 3 * len(evidence.ABLATIONS)
    assert named["torque-seed4"] == ("--controller", "torque", "--seed", "4")
    plan = asked(named["disturbed-torque-plan-seed2"])
    headline = asked(named["disturbed-torque-seed2"])
    assert plan == dataclasses.replace(
        headline, inputs="command", env=headline.env.replace(lean_correction=False), ppo=plan.ppo
    )
    assert plan.ppo.hidden
    others = [asked(named[f"disturbed-velocity-{name}-seed0"]) for name in evidence.ABLATIONS]
    assert asked(named["disturbed-velocity-seed0"]) not in others
