"""Landing: the posture is held (paper section III: position control), or feedback catches."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from icub_jump_env.compiled import compiled
from icub_jump_env.control.ankles import Ankles, ankle_joints, carry
from icub_jump_env.control.catching import Catching, catch
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import SolverName
from icub_jump_env.control.flight import Flight
from icub_jump_env.control.phases import PhaseController, Tick
from icub_jump_env.control.velocity import VelocityQP, VelocityTerms
from icub_jump_env.estimation.state import RobotState
from icub_jump_env.planning.minimum_jerk import MinimumJerk, progress
from icub_jump_env.planning.plan import JumpPlan, Setpoint
from icub_jump_env.planning.residual import ResidualFilter
from icub_jump_env.records import Array, Block
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.limits import JointLimits

COM_WEIGHT, MOMENTUM_WEIGHT = 3e3, 100.0
"""Weights of CoM ((m/s)^-2) and angular momentum ((kg m^2/s)^-2) against the posture."""
POSTURE_WEIGHT, SMOOTHNESS_WEIGHT = (0.3, 0.3, 0.1), (0.05, 0.05, 0.05)
"""Weights of legs, torso and arms, and of closeness to the command before."""
POSTURE_GAIN, HEIGHT_GAIN = 2.0, 10.0
"""Gains of posture and CoM height (1/s)."""
LIMIT_HORIZON, SPEED_SHARE = 0.04, 0.9
"""Position limits must hold after this time (s), speeds within this share of theirs."""
REFERENCE_LEAK, LARGEST_LAG = 2.0, 0.3
"""How fast positions that are not reached are given up (1/s), and the largest gap (rad)."""
LIMIT_MARGIN = 0.01
"""What commanded positions leave of their limits (rad)."""
BRAKING_DEPTH, BRAKING_TIME = 0.06, 0.2
"""How far (m) and how long (s) the CoM sinks at most while the legs brake it."""
LOWEST = 0.39
"""The CoM does not sink below this height, that of the crouch (m)."""
RISING_DELAY, RISING_TIME = 0.05, 0.4
"""When the CoM begins to rise again after it stopped, and how long that takes (s)."""
STAND_AHEAD = 0.008
"""The CoM stands this far ahead of the middle of the soles (m): pushes backward are the harder ones."""
ANKLE_DAMPING = 3.0
"""Torque of the ankles per speed that the QP did not ask for (Nm s/rad)."""
CROUCH_TIME = 0.7
"""How long the motion to the crouch of the next jump takes (s)."""


class Landing(PhaseController, Protocol):
    """A landing, from which another jump can begin."""

    def crouch(self, plan: JumpPlan, time: float) -> None:
        """Move to where ``plan`` begins, from ``time`` (s) on and within :data:`CROUCH_TIME`."""
        ...


class HoldLanding:
    """The motion of the flight goes on to its end, where it stays.

    An early touch-down does not stop the motion, so that chatter cannot either.
    """

    def __init__(self, flight: Flight) -> None:
        self._flight = flight

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """Nothing begins with the touch-down."""

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick, as :class:`icub_jump_env.control.phases.PhaseController`."""
        return self._flight.go_on(time, residual_target)

    def crouch(self, plan: JumpPlan, time: float) -> None:
        """Minimum jerk to the crouch, as :class:`Landing`."""
        self._flight.move_to(plan.stance.posture, time, CROUCH_TIME)


class FeedbackLanding:
    """The legs give way, the ankles balance, and the body lunges if that is not enough.

    Three layers on an inverted pendulum. :func:`icub_jump_env.control.catching.catch` decides
    CoP, lunge and load of the feet from the capture point. The ankles are torque-controlled and
    put the CoP where it says; soles follow the ground, whatever its slope. All other joints are
    position-controlled and follow a velocity QP like eq. 3, whose tasks are height of the CoM,
    angular momentum of the lunge, and posture.

    Attributes:
        setpoint: Its CoM position is relative to the middle of the soles (m).
    """

    def __init__(
        self,
        flight: Flight,
        residual: ResidualFilter,
        dt: float,
        kinematics: FeetFixedKinematics,
        solver: SolverName,
    ) -> None:
        """Set up the phase.

        Args:
            flight: What comes before.
            residual: The filter of the residual.
            dt: Control period (s).
            kinematics: The model, which the estimator keeps up to date.
            solver: QP solver.
        """
        self._flight, self._residual, self._dt = flight, residual, dt
        self._kinematics, self._robot = kinematics, kinematics.robot
        robot, n = kinematics.robot, kinematics.robot.n_joints
        self._ankle_joints = ankle_joints(robot)
        self._ankles = self._ankle_joints.ravel()
        self._ankle_geometry = Ankles.of(robot)
        # NaN leaves a joint to its servo.
        self._damping = np.full(n, np.nan)
        self._damping[self._ankles] = ANKLE_DAMPING
        self._catching = Catching.of(kinematics, dt)
        self._terms = VelocityTerms(
            {"n": n},
            com_weight=COM_WEIGHT,
            momentum_weight=MOMENTUM_WEIGHT,
            posture=POSTURE_GAIN,
            posture_weight=robot.per_joint("posture", POSTURE_WEIGHT),
            smoothness_weight=robot.per_joint("smoothness", SMOOTHNESS_WEIGHT),
            horizon=LIMIT_HORIZON,
            margin=SPEED_SHARE,
            dt=dt,
        )
        self._qp = VelocityQP(self._terms, kinematics, solver)
        self.setpoint = Setpoint.at_rest(robot.landing)
        self._position = np.zeros(n)
        self._limits = JointLimits.of(robot)
        self._stand = np.zeros(n)
        self._stand_height = 0.0
        # Posture (rad), then height and forward place of the CoM (m); none before a crouch.
        self._crouch: MinimumJerk | None = None
        self._crouch_began = 0.0
        self._began = self._touch_height = self._sinking = self._depth = 0.0

    def start(self, state: RobotState, plan: JumpPlan, time: float) -> None:
        """Begin in ``state``, ``time`` (s) after the start of the jump."""
        self._began, self._crouch = time, None
        self.setpoint.posture_velocity[:] = 0.0
        self.setpoint.posture[:] = self._stand[:] = plan.landing_posture
        stance = FeetFixedKinematics(self._robot)
        stance.update(self._stand)
        self._stand_height = float(stance.com[2])
        self._catching.rate = 0.0
        command = self._flight.command
        self._position[:] = state.joint_position if command.position is None else command.position
        self._terms.previous[:] = 0.0
        self._touch_height = float(self._kinematics.com[2])
        self._sinking = self._flight.yielding
        self._depth = max(
            0.0,
            min(BRAKING_DEPTH, self._sinking * BRAKING_TIME / 2, self._touch_height - LOWEST),
        )

    def tick(self, state: RobotState, time: float, residual_target: Array) -> Tick:
        """One control tick, as :class:`icub_jump_env.control.phases.PhaseController`."""
        kinematics, setpoint, dt = self._kinematics, self.setpoint, self._dt
        s = state.joint_position
        self._residual.step(residual_target, dt)
        x, y, z = self._residual.offset[:3].tolist()
        forward, height, rise = self._stand_at(time)
        # The ankles are where balance has them, and the soles tell what is level.
        setpoint.posture[self._ankles] = self._position[self._ankles] = s[self._ankles]
        com = setpoint.com_position
        com[0], com[1], com[2] = forward + x, y, height + z
        lag = height + z - float(kinematics.com[2])
        setpoint.com_velocity[2] = rise + self._residual.velocity[2] + HEIGHT_GAIN * lag
        away = self._position - setpoint.posture
        catching = self._balance(state, com, away)
        setpoint.angular_momentum[1], self._terms.lift = catching.momentum, catching.lift
        solution, report = self._qp.solve(state, setpoint)
        velocity = self._terms.previous
        if report.failed:
            velocity *= 0.8
        else:
            velocity[:] = solution.x
        torque = self._damping.copy()
        follow(state.block, velocity, self._limits.block, dt, self._position, torque)
        joints, ankles = self._ankle_joints, self._ankle_geometry.block
        carry(state.block, joints, catching.cop, catching.pull, ankles, torque)
        command = JointCommand(velocity.copy(), self._position.copy(), torque)
        return Tick(command, report)

    def _balance(self, state: RobotState, com: Array, away: Array) -> Catching:
        """What :func:`icub_jump_env.control.catching.catch` decides."""
        kinematics, catching = self._kinematics, self._catching
        up = kinematics.chest_up()
        catch(kinematics.block, state.block, com, away, up, catching.block)
        return catching

    def crouch(self, plan: JumpPlan, time: float) -> None:
        """The balance goes on while the stand becomes the crouch, as :class:`Landing`."""
        stance = FeetFixedKinematics(self._robot)
        stance.update(plan.stance.posture)
        forward = float(stance.com[0] - stance.sole_positions[:, 0].mean())
        height, _ = self._height(time - self._began)
        start = np.array([*self._stand, height, STAND_AHEAD])
        goal = np.array([*plan.stance.posture, stance.com[2], forward])
        self._crouch, self._crouch_began = MinimumJerk(start, goal, CROUCH_TIME), time

    def _stand_at(self, time: float) -> tuple[float, float, float]:
        """Place of the CoM forward (m), its height (m) and rate (m/s); moves the posture."""
        if self._crouch is None:
            return STAND_AHEAD, *self._height(time - self._began)
        now, rate = self._crouch.sample(time - self._crouch_began)
        self.setpoint.posture[:] = now[:-2]
        # The posture's gain alone would come too late.
        self.setpoint.posture_velocity[:] = rate[:-2]
        return float(now[-1]), float(now[-2]), float(rate[-2])

    def _height(self, since: float) -> tuple[float, float]:
        """Height of the CoM (m) and its rate (m/s), ``since`` (s) the touch-down."""
        speed, depth = self._sinking, self._depth
        braking = 2.0 * depth / speed if depth > 0.0 else 0.0
        if since < braking:
            left = 1.0 - since / braking
            return self._touch_height - depth * (1.0 - left * left), -speed * left
        lowest = self._touch_height - depth
        done, rate = progress(min(max((since - braking - RISING_DELAY) / RISING_TIME, 0.0), 1.0))
        way = self._stand_height - lowest
        return lowest + done * way, rate / RISING_TIME * way


@compiled
def follow(
    state: Block, velocity: Array, limits: Block, dt: float, position: Array, torque: Array
) -> None:
    """Move commanded positions at the velocities that the QP decided.

    Args:
        state: The believed state.
        velocity: (n,) rad/s.
        limits: Of the joints.
        dt: Control period (s).
        position: (n,) commanded positions (rad), which this moves.
        torque: (n,) torque per speed that the QP did not ask for (Nm s/rad); this makes it the
            torque (Nm).
    """
    s, bounds = state[0], limits[0]
    for j in range(position.shape[0]):
        lag = min(max(s.joint_position[j] - position[j], -LARGEST_LAG), LARGEST_LAG)
        moved = position[j] + dt * (velocity[j] + REFERENCE_LEAK * lag)
        lowest, highest = bounds.lower[j] + LIMIT_MARGIN, bounds.upper[j] - LIMIT_MARGIN
        position[j] = min(max(moved, lowest), highest)
        torque[j] *= velocity[j] - s.joint_velocity[j]
