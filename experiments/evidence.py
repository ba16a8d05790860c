"""Remake what the documents say about learning: runs, shipped policies, rivals, pictures.

    python -m experiments.evidence

trains whatever is not finished in runs/ (hours on two cores; an interrupted one goes on),
fills experiments/runs/ and icub_jump_env/policy/shipped/, draws the learning curves, and runs docs/update.py.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from agents.options import OPTIONS, TrainOptions, read_options
from agents.training import BEST, CURVE, LAST, other_code
from experiments.figures import learning_curves
from experiments.rivals import best_constant, open_loop
from experiments.seeds import TEST
from experiments.shipped import CURVE_SUFFIX, REPOSITORY, RUNS
from icub_jump_env.checks import check_count
from icub_jump_env.control.config import ControllerName
from icub_jump_env.errors import ICubJumpError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.contender import Contender, read_contenders
from icub_jump_env.evaluation.episodes.series import Series
from icub_jump_env.evaluation.quantities import CONTROLLERS
from icub_jump_env.evaluation.report.output import say
from icub_jump_env.evaluation.report.provenance import SOURCE, source, versions
from icub_jump_env.evaluation.statistics.summary import Summary
from icub_jump_env.policy import NetworkPolicy, ReplayPolicy, load_policy, save_policy
from icub_jump_env.policy.saving import SHIPPED, LoadedPolicy

EVIDENCE = Path("runs/evidence")
"""Where the runs are, in it."""

HEADLINE_SEEDS = range(5)
ABLATION_SEEDS = range(1)

ABLATIONS = {
    "forward": ("--axes", "forward"),
    "vertical": ("--axes", "vertical"),
    "all-axes": ("--axes", "forward", "lateral", "vertical"),
    "nominal": ("--randomization", "none"),
    # Its episodes have three times as many steps.
    "all-phases": ("--residual-phases", "all", "--timesteps", "300000"),
}
"""Arguments of train.py that make each ablation, of the velocity controller."""

PLAN = ("--inputs", "command")
"""Those of a policy that sees command and time alone."""


class EvidenceError(ICubJumpError, RuntimeError):
    """A part of the evidence could not be remade."""


@dataclass(frozen=True)
class EvidenceOptions:
    """Remake the evidence.

    Attributes:
        jobs: Processes that evaluate in parallel.
        train_only: Train, and leave shipped policies and documents as they are.
    """

    jobs: int = 1
    train_only: bool = False

    def __post_init__(self) -> None:
        check_count("jobs", self.jobs, 1, unit="processes")


def trainings() -> dict[str, tuple[str, ...]]:
    """Arguments of train.py for every training, by the name of its policy."""
    named: dict[str, tuple[str, ...]] = {}
    for seed in HEADLINE_SEEDS:
        for controller in CONTROLLERS:
            named[f"{controller}-seed{seed}"] = ("--controller", controller, "--seed", str(seed))
    for seed in ABLATION_SEEDS:
        for controller in CONTROLLERS:
            words = ("--controller", controller, *PLAN, "--seed", str(seed))
            named[f"{controller}-plan-seed{seed}"] = words
        for name, arguments in ABLATIONS.items():
            named[f"velocity-{name}-seed{seed}"] = (*arguments, "--seed", str(seed))
    return named


def remake(options: EvidenceOptions) -> None:
    """Remake everything.

    Raises:
        EvidenceError: If a command fails, or a folder holds a run that is not the one asked
            for or was made by other code.
    """
    console = Console(stderr=True)
    for name, arguments in trainings().items():
        say(console, f"run {name}")
        _train(name, arguments)
    for file in RUNS.glob("*-seed*.*"):
        if file.name.split(".")[0] not in trainings():
            say(console, f"removing {file}, which is no longer trained")
            file.unlink()
    if options.train_only:
        return
    for controller in CONTROLLERS:
        shipped = _ship(controller, options.jobs, console)
        _make_rivals(controller, shipped, options.jobs, console)
    learning_curves(RUNS).savefig(REPOSITORY / "docs" / "images" / "learning.png")
    _run("docs/update.py")


def _train(name: str, arguments: tuple[str, ...]) -> None:
    """Train or go on, and keep the best policy and the learning curve."""
    words = (*arguments, "--run", str(EVIDENCE / name))
    folder = REPOSITORY / EVIDENCE / name
    if (folder / OPTIONS).exists():
        if read_options(folder / OPTIONS).as_dict() != parse(TrainOptions, arguments).as_dict():
            raise EvidenceError(f"{EVIDENCE / name} holds a run with other options: remove it")
        _check_code(folder, LAST)
        words = ("--resume", str(EVIDENCE / name))
    _run("train.py", *words)
    _check_code(folder, BEST)
    RUNS.mkdir(parents=True, exist_ok=True)
    for suffix in (".safetensors", ".json"):
        shutil.copy((folder / BEST).with_suffix(suffix), RUNS / f"{name}{suffix}")
    shutil.copy(folder / CURVE, RUNS / f"{name}{CURVE_SUFFIX}")


def _check_code(folder: Path, name: str) -> None:
    """See that a policy of a run jumped with the present code."""
    if other_code(folder / name):
        raise EvidenceError(f"{folder} holds a run of other code: remove it")


def _run(*words: str) -> None:
    try:
        subprocess.run([sys.executable, *words], cwd=REPOSITORY, check=True)
    except subprocess.CalledProcessError as error:
        raise EvidenceError(f"failed: python {shlex.join(words)}") from error


def _ship(controller: ControllerName, jobs: int, console: Console) -> LoadedPolicy:
    """The best of the headline runs; its card says how it does on held-out seeds."""
    names = [f"{controller}-seed{seed}.safetensors" for seed in HEADLINE_SEEDS]
    contenders = read_contenders([str(RUNS / name) for name in names])
    best = max(contenders, key=lambda contender: _selection(contender)["score"])
    assert isinstance(best.policy, LoadedPolicy)  # it was read from a file
    card = best.policy.card
    summary = Summary.of(Series(card.config, TEST, best).complete(jobs, console))
    test = {
        "seeds": [TEST.start, TEST.stop],
        "success": summary.success.as_dict(),
        "landed": summary.landed.as_dict(),
        "mean_rise": summary.mean_rise,
    }
    path = SHIPPED / f"{controller}.safetensors"
    save_policy(
        path,
        best.policy.policy,
        config=card.config,
        versions=card.versions,
        command=card.command,
        seed=card.seed,
        results={"selection": _selection(best), "test": test},
    )
    return load_policy(path)


def _selection(contender: Contender) -> Mapping[str, Any]:
    """The evaluation that made this policy the best of its run."""
    assert contender.card is not None  # it was read from a file
    evaluation: Mapping[str, Any] = contender.card.results["evaluation"]
    return evaluation


def _make_rivals(
    controller: ControllerName, policy: LoadedPolicy, jobs: int, console: Console
) -> None:
    """A constant shift and the shipped policy's mean action, in the same format."""
    config = policy.card.config
    rivals: dict[str, NetworkPolicy | ReplayPolicy] = {
        "constant": best_constant(config, jobs, console),
        "open-loop": open_loop(policy, config, console),
    }
    for name, rival in rivals.items():
        save_policy(
            SHIPPED / f"{controller}-{name}.safetensors",
            rival,
            config=config,
            versions=versions() | {SOURCE: source()},
            command=("python", "-m", "experiments.evidence"),
            seed=None,
            results={},
        )


if __name__ == "__main__":
    guarded(lambda: remake(parse(EvidenceOptions, sys.argv[1:])))
