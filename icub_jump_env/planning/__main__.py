"""Make a family of whole-body plans (extra 'planning').

    python -m icub_jump_env.planning --controller torque
    python -m icub_jump_env.planning --robot iCubGenova02 --output genova02

writes one npz file and its JSON card, and prints the plans. Follow them with
``gymnasium.make("ICubJump-v0", planner="whole_body", plans="genova02.npz", ...)``.
"""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from icub_jump_env.checks import check_choice
from icub_jump_env.control.config import CONTROLLERS, ControllerName
from icub_jump_env.errors import MissingDependencyError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.planning.whole_body.margins import MARGINS
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.robot.urdf import DEFAULT_MODEL


@dataclass(frozen=True)
class PlanningOptions:
    """Make a family of whole-body plans.

    Attributes:
        robot: Model of the icub-models package.
        controller: What shall follow the plans.
        output: File to write; by default ROBOT-CONTROLLER.npz.
    """

    robot: str = DEFAULT_MODEL
    controller: ControllerName = "velocity"
    output: Path | None = None

    def __post_init__(self) -> None:
        check_choice("controller", self.controller, tuple(CONTROLLERS))
        load_robot(self.robot)


def make_plans(options: PlanningOptions) -> None:
    """Optimise, calibrate and write the family."""
    if importlib.util.find_spec("casadi") is None:
        raise MissingDependencyError.of_extra("making plans", "planning")
    from icub_jump_env.evaluation.calibration import calibrate
    from icub_jump_env.evaluation.report.output import new_table, say, show
    from icub_jump_env.planning.whole_body.build import build_family

    began = time.perf_counter()
    family = build_family(
        load_robot(options.robot), options.controller, MARGINS[options.controller]
    )
    optimised = time.perf_counter()
    family = calibrate(family)
    done = time.perf_counter()
    path = options.output or Path(f"{options.robot}-{options.controller}")
    path = path.with_suffix(".npz")
    family.save(path)
    table = new_table(0, "plan, cm", "jump, cm")
    for plan in family.card["plans"]:
        table.add_row(f"{100 * plan['height']:.2f}", f"{100 * plan['rise']:.2f}")
    console = Console()
    say(console, f"{options.robot}, {options.controller} controller")
    show(console, table)
    say(console, f"physical optimum: {100 * family.optimum:.2f} cm")
    say(console, f"the highest plan is bound by {', '.join(family.card['plans'][-1]['binding'])}")
    print(f"wrote {path}", file=sys.stderr)
    print(
        f"optimised in {optimised - began:.0f} s, jumped in {done - optimised:.0f} s",
        file=sys.stderr,
    )


def run(arguments: Sequence[str]) -> None:
    """Run the command with these arguments."""
    guarded(lambda: make_plans(parse(PlanningOptions, arguments)))


if __name__ == "__main__":
    run(sys.argv[1:])
