"""What a residual wins by what it feels: the policies of five trainings among simpler arms.

    python -m experiments.arms --controller velocity --jobs 2

In ``disturbed`` worlds, on the same held-out episodes for all. Constant, replayed actions and the
height asked for are chosen on tuning seeds, plans and policies on those of the selection. An
interrupted evaluation goes on where it stopped.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from rich.console import Console
from rich.table import Table

from experiments.ablations import Array, cells_of, jumps_of
from experiments.headroom import starts
from experiments.rivals import best_constant, open_loop
from experiments.seeds import FELT_TEST, TUNING
from experiments.shipped import RUNS, best_of, judged_config
from icub_jump_env.checks import check_count
from icub_jump_env.config import JumpConfig
from icub_jump_env.control.config import ControllerName
from icub_jump_env.errors import PolicyFileError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.contender import BASELINE, Contender, read_contenders
from icub_jump_env.evaluation.episodes.failures import failure_of
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.episodes.series import Series
from icub_jump_env.evaluation.quantities import CM, seeds
from icub_jump_env.evaluation.report.output import new_table, show
from icub_jump_env.evaluation.statistics.intervals import CONFIDENCE
from icub_jump_env.planning.lean import MOMENTUM_PER_LEAN
from icub_jump_env.planning.residual import AXES
from icub_jump_env.policy import ReplayPolicy

TUNED_ON = TUNING[:100]
LAW, OURS = "lean felt: the law", "policy on the law"

MORE: Mapping[ControllerName, float] = MappingProxyType({"velocity": 0.002, "torque": 0.0})
"""By which the policies are asked to jump higher than the command (m).

The law takes as much rise of the velocity controller. Chosen on
:data:`~experiments.seeds.FELT_TUNING`: so asked its policies rise as high as what feels nothing, and
succeed as often as without. The torque controller's rise as high anyway, and would succeed less.
"""

HIGHER = (-0.005, 0.0, 0.005, 0.01)
"""By which the law is asked to jump higher than the command (m)."""


@dataclass(frozen=True)
class ArmsOptions:
    """Compare the policies with arms that feel less.

    Attributes:
        controller: Controller of the launching phase.
        episodes: Of each arm, at most 500.
        jobs: Processes that work in parallel.
    """

    controller: ControllerName = "velocity"
    episodes: int = len(FELT_TEST)
    jobs: int = 1

    def __post_init__(self) -> None:
        check_count("episodes", self.episodes, 2, len(FELT_TEST))
        check_count("jobs", self.jobs, 1, unit="processes")


@dataclass(frozen=True)
class Arm:
    """What jumps.

    Attributes:
        name: Its name in the table.
        config: The jump.
        contenders: What acts in it; several are trainings that differ in their seed.
        higher: By how much the command is above the one that it is judged by (m).
    """

    name: str
    config: JumpConfig
    contenders: Sequence[Contender] = (BASELINE,)
    higher: float = 0.0

    def episodes(self, used: range, jobs: int, progress: Console) -> list[list[Episode]]:
        """Its episodes, of each contender."""
        low, high = self.config.jump_heights
        config = self.config.replace(jump_height=(low + self.higher, high + self.higher))
        series = [Series(config, used, contender) for contender in self.contenders]
        return [
            [self._judged(episode) for episode in each.complete(jobs, progress)] for each in series
        ]

    def _judged(self, episode: Episode) -> Episode:
        command = episode.jump_height - self.higher
        failure = failure_of(episode.outcome, episode.jump, command, self.config.success)
        return dataclasses.replace(episode, jump_height=command, is_success=failure is None)

    def jumps(self, used: range, jobs: int, progress: Console) -> Array:
        """Success (%), rise and height of the soles (cm) of each contender and episode (k, 3, n)."""
        return np.stack([jumps_of(each) for each in self.episodes(used, jobs, progress)])


def policies(kind: str) -> list[Contender]:
    """The policies of a kind of training.

    Raises:
        PolicyFileError: If there are none.
    """
    files = sorted(RUNS.glob(f"{kind}-seed*.safetensors"))
    if not files:
        raise PolicyFileError(f"{RUNS}/{kind}-seed*.safetensors", "no such files")
    return read_contenders([str(file) for file in files])


def felt_by_none(policy: ReplayPolicy, config: JumpConfig) -> ReplayPolicy:
    """Replayed actions, and with them what the law does in the mean."""
    backward = np.mean([max(0.0, -start.lean[0]) for start in starts(config, TUNED_ON)])
    actions, pitch = policy.actions.copy(), policy.axes.index("pitch")
    actions[..., pitch] += (
        MOMENTUM_PER_LEAN * backward / config.residual.scale[AXES.index("pitch")]
    )
    return dataclasses.replace(policy, actions=np.clip(actions, -1.0, 1.0))


def arms(controller: ControllerName, jobs: int, progress: Console) -> list[Arm]:
    """All of them, the policies last."""
    trained = policies(f"disturbed-{controller}")
    best = best_of(trained)
    law = judged_config(best)
    unfelt = law.replace(lean_correction=False)
    plans = policies(f"disturbed-{controller}-plan")
    replay = open_loop(best.policy, law, progress, TUNED_ON)

    def constant(config: JumpConfig) -> Contender:
        found = best_constant(config, jobs, progress, TUNED_ON)
        shift = " ".join(f"{value:+g}" for value in found.layers[0][1])
        return Contender(f"constant {shift}", found)

    def named(name: str, policy: ReplayPolicy) -> Contender:
        return Contender(f"{name} of {best.name}", policy)

    before = [
        Arm("nothing felt: zero", unfelt),
        Arm("constant", unfelt, [constant(unfelt)]),
        Arm("plan", unfelt, plans),
        Arm("replay", unfelt, [named("replay with the mean law", felt_by_none(replay, law))]),
        Arm(LAW, law),
        Arm("law and constant", law, [constant(law)]),
        Arm("law and replay", law, [named("replay", replay)]),
    ]
    more, mine = MORE[controller], Arm(OURS, law, trained)
    ours = asked_for_more(mine, more)
    found = [
        *before, asked_for_more(Arm(LAW, law), more), *strongest(law, ours, jobs, progress), mine, ours,
    ]  # fmt: skip
    return list({arm.name: arm for arm in found}.values())  # without more, two are there twice


def asked_for_more(arm: Arm, more: float) -> Arm:
    """An arm that is asked for ``more`` (m) than the command."""
    if more == 0.0:
        return arm
    return dataclasses.replace(arm, name=f"{arm.name}, {CM * more:+g} cm", higher=more)


def strongest(law: JumpConfig, ours: Arm, jobs: int, progress: Console) -> list[Arm]:
    """The law asked for another height: matched with the policies on rise, and on success.

    Of those that rise as high the most successful, and of those that succeed as often the highest;
    if there are none, of all. Not the law itself, which is an arm anyway.
    """
    asked = [Arm(f"law, {CM * higher:+g} cm", law, higher=higher) for higher in HIGHER]
    means = [arm.jumps(TUNED_ON, jobs, progress).mean(axis=(0, 2)) for arm in asked]
    wanted = ours.jumps(TUNED_ON, jobs, progress).mean(axis=(0, 2))
    chosen = {}
    for measure, quantity, other in (("rise", 1, 0), ("success", 0, 1)):
        all_of_them = list(range(len(asked)))
        matched = [i for i in all_of_them if means[i][quantity] >= wanted[quantity]]
        best = max(matched or all_of_them, key=lambda i: means[i][other if matched else quantity])
        chosen[f"matched on {measure}" if matched else f"best in {measure}"] = asked[best]
    return [
        dataclasses.replace(arm, name=f"{arm.name}, {how}")
        for how, arm in chosen.items()
        if arm.higher
    ]


def render(
    compared: Sequence[Arm], jumps: Sequence[Array], used: range, own: bool = False
) -> Table:
    """A row for each arm; the last is compared with all others.

    Args:
        compared: The arms.
        jumps: What they did (k, 3, n).
        used: Seeds of the episodes.
        own: Whether runs are compared one by one, where there are as many; else with the mean of
            the others.
    """
    *others, ours = jumps
    confidence = 1.0 - (1.0 - CONFIDENCE) / max(1, len(others))
    table = new_table(
        1, "arm", "runs", "success, %", "policy gains", "rise, cm", "policy gains",
        "soles, cm", "policy gains",
    )  # fmt: skip
    for arm, done in zip(compared, jumps, strict=True):
        theirs = done if own and len(done) == len(ours) else done.mean(axis=0)
        gains = None if done is ours else ours - theirs
        table.add_row(arm.name, str(len(done)), *cells_of(done, gains, confidence))
    table.caption = (
        f"{seeds(used)}; interquartile means over trainings; intervals over training seeds and "
        f"episodes, of 95 % for the {len(others)} comparisons together"
    )
    return table


def compare(options: ArmsOptions) -> None:
    """Choose on tuning seeds, jump the held-out ones, print; then the same worlds as ``hard``."""
    console, progress = Console(), Console(stderr=True)
    compared = arms(options.controller, options.jobs, progress)
    used = FELT_TEST[: options.episodes]
    for world, these in (
        ("disturbed", compared),
        ("hard", [arm for arm in compared if arm.name.startswith((LAW, OURS))]),
    ):
        there = [
            dataclasses.replace(arm, config=arm.config.replace(randomization=world))
            for arm in these
        ]
        done = [arm.jumps(used, options.jobs, progress) for arm in there]
        table = render(there, done, used)
        table.title = f"{options.controller} controller, {world}, v1, 4 to 6 cm"
        show(console, table)


if __name__ == "__main__":
    guarded(lambda: compare(parse(ArmsOptions, sys.argv[1:])))
