"""Remake what the documents say about learning: runs, shipped policies, rivals, pictures.

    python -m agents.evidence

trains whatever is not finished in runs/ (hours on two cores; an interrupted one goes on),
fills agents/pretrained/, draws the learning curves, and runs docs/update.py.
"""

from __future__ import annotations

import json
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from rich.console import Console

from agents.arms import best_constant, open_loop
from agents.curves import learning_curves
from agents.options import OPTIONS, TrainOptions, read_options
from agents.training import BEST, CURVE
from icub_jump_env.checks import check_count
from icub_jump_env.config import ControllerName
from icub_jump_env.errors import ICubJumpError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.output import say
from icub_jump_env.evaluation.parallel import check_jobs
from icub_jump_env.evaluation.provenance import SOURCE, source, versions
from icub_jump_env.policy import NetworkPolicy, ReplayPolicy, load_policy, save_policy

PRETRAINED = Path("agents/pretrained")
IMAGES = Path("docs/images")
HEADLINE_SEEDS = range(5)
ABLATION_SEEDS = range(1)

ABLATIONS = {
    "plan": ("--inputs", "command"),
    "forward": ("--axes", "forward"),
    "vertical": ("--axes", "vertical"),
    "all-axes": ("--axes", "forward", "lateral", "vertical"),
    "nominal": ("--randomization", "none"),
    "full": ("--randomization", "full"),
    "all-phases": ("--residual-phases", "all"),
}
"""Arguments of train.py that make each ablation."""


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
        check_count("jobs", self.jobs, 1)


def runs() -> dict[str, tuple[str, ...]]:
    """Arguments of train.py for every training, by the name of its policy."""
    named: dict[str, tuple[str, ...]] = {}
    for seed in HEADLINE_SEEDS:
        for controller in get_args(ControllerName):
            named[f"{controller}-seed{seed}"] = ("--controller", controller, "--seed", str(seed))
    for name, arguments in ABLATIONS.items():
        for seed in ABLATION_SEEDS:
            named[f"velocity-{name}-seed{seed}"] = (*arguments, "--seed", str(seed))
    return named


def _train(name: str, arguments: tuple[str, ...], console: Console) -> None:
    say(console, f"run {name}")
    folder = Path("runs/evidence") / name
    words = (*arguments, "--run", str(folder))
    if (folder / OPTIONS).exists():
        if read_options(folder / OPTIONS).as_dict() != parse(TrainOptions, arguments).as_dict():
            raise EvidenceError(f"{folder} holds a run with other options: remove it")
        words = ("--resume", str(folder))
    _run("train.py", *words)
    if load_policy(folder / BEST).card.versions.get(SOURCE) != source():
        raise EvidenceError(f"{folder} holds a run of other code: remove it")
    kept = PRETRAINED / "runs"
    kept.mkdir(parents=True, exist_ok=True)
    for suffix in (".safetensors", ".json"):
        shutil.copy((folder / BEST).with_suffix(suffix), kept / f"{name}{suffix}")
    shutil.copy(folder / CURVE, kept / f"{name}.curve.json")


def _run(*words: str) -> None:
    try:
        subprocess.run([sys.executable, *words], check=True)
    except subprocess.CalledProcessError as error:
        raise EvidenceError(f"failed: python {shlex.join(words)}") from error


def _ship(controller: ControllerName) -> None:
    """The best of the headline runs."""
    candidates = [PRETRAINED / "runs" / f"{controller}-seed{seed}.json" for seed in HEADLINE_SEEDS]
    best = max(candidates, key=_score)
    for suffix in (".safetensors", ".json"):
        shutil.copy(best.with_suffix(suffix), PRETRAINED / f"{controller}{suffix}")


def _make_rivals(controller: ControllerName, jobs: int, console: Console) -> None:
    """A constant shift and the shipped policy's mean action, in the same format."""
    policy = load_policy(PRETRAINED / f"{controller}.safetensors")
    config = policy.card.config
    rivals: dict[str, NetworkPolicy | ReplayPolicy] = {
        "constant": best_constant(config, jobs, console),
        "open-loop": open_loop(policy, config, console),
    }
    for name, rival in rivals.items():
        save_policy(
            PRETRAINED / f"{controller}-{name}.safetensors",
            rival,
            config=config,
            versions=versions(),
            command=("python", "-m", "agents.evidence"),
            seed=None,
            results={},
        )


def _score(card: Path) -> float:
    return float(json.loads(card.read_text())["results"]["evaluation"]["score"])


def remake(options: EvidenceOptions) -> None:
    """Remake everything."""
    console = Console(stderr=True)
    check_jobs(options.jobs)
    for name, arguments in runs().items():
        _train(name, arguments, console)
    if options.train_only:
        return
    for controller in get_args(ControllerName):
        _ship(controller)
        _make_rivals(controller, options.jobs, console)
    learning_curves(PRETRAINED / "runs").savefig(IMAGES / "learning.png")
    _run("docs/update.py")


if __name__ == "__main__":
    guarded(lambda: remake(parse(EvidenceOptions, sys.argv[1:])))
