"""Remake what the documents say about learning: runs, shipped policies, rivals, pictures.

    python -m experiments.evidence

trains whatever is not finished in runs/ (hours on two cores; an interrupted one goes on),
fills experiments/runs/ and icub_jump_env/policy/shipped/, draws the learning curves, and runs docs/update.py.
"""

from __future__ import annotations

import itertools
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.console import Console

from agents.cli import asked
from agents.options import OPTIONS, read_options
from agents.training import BEST, CURVE, LAST, other_code
from experiments.figures import learning_curves
from experiments.rivals import best_constant, open_loop
from experiments.seeds import FELT_TEST, TEST
from experiments.shipped import CURVE_SUFFIX, REPOSITORY, RUNS, best_of, selection_of
from icub_jump_env.checks import check_count
from icub_jump_env.control.config import ControllerName
from icub_jump_env.errors import ICubJumpError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.contender import read_contenders
from icub_jump_env.evaluation.episodes.series import Series
from icub_jump_env.evaluation.figures.style import name_origins
from icub_jump_env.evaluation.quantities import CONTROLLERS
from icub_jump_env.evaluation.report.output import say
from icub_jump_env.evaluation.report.provenance import SOURCE, source, versions
from icub_jump_env.evaluation.statistics.summary import Summary
from icub_jump_env.planning.residual import AXES
from icub_jump_env.policy import NetworkPolicy, ReplayPolicy, load_policy, save_policy
from icub_jump_env.policy.saving import SHIPPED, LoadedPolicy

EVIDENCE = Path("runs/evidence")
"""Where the runs are, in it."""

HEADLINE_SEEDS = range(5)
ABLATION_SEEDS = range(3)

DISTURBED = ("--config", "agents/hyperparameters/disturbed.json")
"""Arguments of train.py for the task in which a policy wins by what it feels."""

NETWORK = (
    *("--ppo.hidden", "32", "32", "--ppo.learning-rate", "5e-4"),
    *("--ppo.log-std", "-1.7", "-2.5"),
)
"""Those of a policy that is no linear feedback."""

PLAN = ("--inputs", "command", *NETWORK, "--no-lean-correction")
"""Those of one that sees command and time alone, and corrects no lean."""

ABLATIONS = {
    "unfelt": ("--inputs", "command", *NETWORK),
    "history": ("--observation.history", "4"),
    "same-critic": ("--critic", "observation"),
    "all-axes": ("--residual.axes", *AXES, "--axes", *AXES),
    "fast-filter": ("--residual.bandwidth", "40"),
    "without-law": ("--no-lean-correction",),
}
"""Those that make each ablation there, of the velocity controller."""


class EvidenceError(ICubJumpError, RuntimeError):
    """A part of the evidence could not be remade."""


@dataclass(frozen=True)
class EvidenceOptions:
    """Remake the evidence.

    Attributes:
        jobs: Processes that evaluate in parallel.
        only: Only the trainings, or only what is made of the policies in experiments/runs.
    """

    jobs: int = 1
    only: Literal["trainings", "rest"] | None = None

    def __post_init__(self) -> None:
        check_count("jobs", self.jobs, 1, unit="processes")


def trainings() -> dict[str, tuple[str, ...]]:
    """Arguments of train.py for every training, by the name of its policy."""
    named: dict[str, tuple[str, ...]] = {}
    for controller, seed in itertools.product(CONTROLLERS, HEADLINE_SEEDS):
        own = ("--controller", controller, "--seed", str(seed))
        named[f"{controller}-seed{seed}"] = own
        named[f"disturbed-{controller}-seed{seed}"] = (*DISTURBED, *own)
    for controller, seed in itertools.product(CONTROLLERS, ABLATION_SEEDS):
        own = ("--controller", controller, "--seed", str(seed))
        named[f"disturbed-{controller}-plan-seed{seed}"] = (*DISTURBED, *own, *PLAN)
    for (name, arguments), seed in itertools.product(ABLATIONS.items(), ABLATION_SEEDS):
        named[f"disturbed-velocity-{name}-seed{seed}"] = (
            *DISTURBED, "--seed", str(seed), *arguments,
        )  # fmt: skip
    return named


def remake(options: EvidenceOptions) -> None:
    """Remake everything.

    Raises:
        EvidenceError: If a command fails, or a folder holds a run that is not the one asked
            for or was made by other code.
    """
    console = Console(stderr=True)
    if options.only != "rest":
        for name, arguments in trainings().items():
            say(console, f"run {name}")
            _train(name, arguments)
    for file in RUNS.glob("*-seed*.*"):
        if file.name.split(".")[0] not in trainings():
            say(console, f"removing {file}, which is no longer trained")
            file.unlink()
    if options.only == "trainings":
        return
    for controller in CONTROLLERS:
        shipped = _ship(controller, TEST, options.jobs, console)
        _make_rivals(controller, shipped, options.jobs, console)
        _ship(f"disturbed-{controller}", FELT_TEST, options.jobs, console)
    images = REPOSITORY / "docs" / "images"
    name_origins(learning_curves(RUNS)).savefig(images / "learning.png")
    name_origins(learning_curves(RUNS, "disturbed-")).savefig(images / "learning_disturbed.png")
    _run("docs/update.py")


def _train(name: str, arguments: tuple[str, ...]) -> None:
    """Train or go on, and keep the best policy and the learning curve."""
    words = (*arguments, "--run", str(EVIDENCE / name))
    folder = REPOSITORY / EVIDENCE / name
    if (folder / OPTIONS).exists():
        if read_options(folder / OPTIONS).as_dict() != asked(arguments).as_dict():
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


def _ship(name: str, seeds: range, jobs: int, console: Console) -> LoadedPolicy:
    """The best of some headline runs; its card says how it does on held-out seeds."""
    names = [f"{name}-seed{seed}.safetensors" for seed in HEADLINE_SEEDS]
    contenders = read_contenders([str(RUNS / name) for name in names])
    best = best_of(contenders)
    assert isinstance(best.policy, LoadedPolicy)  # it was read from a file
    card = best.policy.card
    summary = Summary.of(Series(card.config, seeds, best).complete(jobs, console))
    test = {
        "seeds": [seeds.start, seeds.stop],
        "success": summary.success.as_dict(),
        "landed": summary.landed.as_dict(),
        "mean_rise": summary.mean_rise,
    }
    path = SHIPPED / f"{name}.safetensors"
    save_policy(
        path,
        best.policy.policy,
        config=card.config,
        versions=card.versions,
        command=card.command,
        seed=card.seed,
        results={"selection": selection_of(best), "test": test},
    )
    return load_policy(path)


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
