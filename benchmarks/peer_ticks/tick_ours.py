"""Ours, from readings to command; the bare solver at the same states; MuJoCo's step."""

import sys
from collections.abc import Callable

import mujoco
import numpy as np
from common import Launch, serve

from icub_jump_env.control.config import CONTROLLERS, ControllerName, TorqueConfig
from icub_jump_env.control.qp.solvers import DAQPSolver
from icub_jump_env.control.torque import TorqueController
from icub_jump_env.control.velocity import VelocityController
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.planning.reference import Reference
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.planning.scaled_curve import ScaledCurvePlan, plan_com_trajectory
from icub_jump_env.robot.frames import mujoco_qpos
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.robot.statics import make_stance
from icub_jump_env.simulation.physics import Physics

ACTIVE = 1e-9
"""Multiplier beyond which an inequality counts as active."""


class OurTick:
    """The tick of a controller, from readings to joint command.

    Attributes:
        launch: Where it decides.
    """

    def __init__(self, name: ControllerName, launch: Launch) -> None:
        self.launch = launch
        robot = load_robot()
        kinematics = FeetFixedKinematics(robot)
        self._estimator = FeetFixedEstimator(kinematics)
        self._reference = Reference(ResidualFilter(bandwidth=15.0))
        self._stance = make_stance(kinematics, robot.crouch)
        self._plan = ScaledCurvePlan(plan_com_trajectory(0.04), robot, self._stance)
        config = CONTROLLERS[name]
        self._controller: VelocityController | TorqueController
        if isinstance(config, TorqueConfig):
            self._controller = TorqueController(config, kinematics)
        else:
            self._controller = VelocityController(config, kinematics)
        self._readings = [
            Readings({"n": robot.n_joints}, joint_position=q[7:], joint_velocity=v[6:])
            for q, v in zip(launch.q, launch.v, strict=True)
        ]
        self._solver = DAQPSolver(self._controller.qp.problem)
        self(0)

    def __call__(self, state: int) -> None:
        """All of a control tick."""
        if state == 0:
            start = self._estimator.estimate(self._readings[0])
            self._reference.start(self._plan, start.com)
            self._controller.reset(self._stance)
        believed = self._estimator.estimate(self._readings[state])
        self._reference.update(state * self.launch.dt)
        self._controller.command(believed, self._reference.setpoint)

    def active(self) -> list[bool]:
        """For each state whether an inequality is active."""
        problem, found = self._controller.qp.problem, []
        for state in range(len(self.launch.q)):
            self(state)
            multipliers = self._solver.solve().multipliers
            inequalities = multipliers[: len(multipliers) - problem.n_equalities]
            found.append(bool((np.abs(inequalities) > ACTIVE).any()))
        return found

    def bare(self) -> Callable[[int], object]:
        """The solver alone, with the problem of each state."""
        problem, problems = self._controller.qp.problem, []
        arrays = ("H", "g", "C", "lower", "upper")
        for state in range(len(self.launch.q)):
            self(state)
            problems.append({name: getattr(problem, name).copy() for name in arrays})
        solver = DAQPSolver(problem)

        def solve(state: int) -> object:
            vars(problem).update(problems[state])
            return solver.solve()

        return solve


def physics_step(launch: Launch) -> Callable[[int], object]:
    """One ``mj_step`` of 1 ms from each state; MuJoCo's time beside setting the state."""
    physics = Physics(load_robot(), 1e-3)
    model, data = physics.model, physics.data
    positions = [mujoco_qpos(q) for q in launch.q]

    def step(state: int) -> None:
        data.qpos[:] = positions[state]
        mujoco.mj_step(model, data)

    return step


velocity, torque = Launch(sys.argv[1], "velocity"), Launch(sys.argv[1], "torque")
ours = {"velocity": OurTick("velocity", velocity), "torque": OurTick("torque", torque)}
active = {name: tick.active() for name, tick in ours.items()}
serve(
    {f"ours, {name}": (tick.launch, tick) for name, tick in ours.items()}
    | {
        f"bare DAQP, {name}": (launch, OurTick(name, launch).bare())
        for name, launch in (("velocity", velocity), ("torque", torque))
    }
    | {"mj_step": (velocity, physics_step(velocity))},
    {f"ours, {name}": found for name, found in active.items()},
)
