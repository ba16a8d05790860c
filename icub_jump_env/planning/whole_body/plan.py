"""A whole-body plan: joint trajectories, from which everything else follows by the model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.robot.kinematics import FeetFixedKinematics
from icub_jump_env.robot.statics import make_stance

Array = NDArray[np.float64]

# Quintic on u in [0, 1] from value, first and second derivative at both ends: its coefficients
# solve this system.
_QUINTIC = np.linalg.inv(
    [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 2.0, 0.0, 0.0, 0.0],
        [1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
        [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
        [0.0, 0.0, 2.0, 6.0, 12.0, 20.0],
    ]
)


class JointKnots(NamedTuple):
    """Joint trajectories of the launch, accelerations linear between evenly spaced knots.

    Attributes:
        duration: T (s).
        position, velocity, acceleration: (k, n) rad, rad/s, rad/s^2.
    """

    duration: float
    position: Array
    velocity: Array
    acceleration: Array


class WholeBodyPlan:
    """Joint trajectories with the soles flat on the floor, until take-off.

    Joints, CoM and momentum are quintic between the knots, through their values and first two
    derivatives there; for the joints that is the cubic that was planned.

    Attributes:
        duration: T (s).
        displacement: CoM rise from the crouch to take-off (m).
        stance: The crouch.
        landing_posture: (n,) posture of flight and landing (rad).
        retraction_time: Duration of the motion to it (s).
    """

    def __init__(
        self,
        knots: JointKnots,
        landing_posture: Array,
        retraction_time: float,
        kinematics: FeetFixedKinematics,
    ) -> None:
        """Compute CoM and momentum along the trajectories.

        Args:
            knots: The joint trajectories.
            landing_posture: (n,) rad.
            retraction_time: s.
            kinematics: The model; it is updated for the crouch.
        """
        self.duration = knots.duration
        self.landing_posture = landing_posture
        self.retraction_time = retraction_time
        self.stance = make_stance(kinematics, knots.position[0])
        com, com_rate, com_rate2, momentum, momentum_rate = centroidal(kinematics, knots)
        self.displacement = float(com[-1, 2] - com[0, 2])
        self._dt = dt = knots.duration / (len(com) - 1)
        # What the momentum adds up to, so that one polynomial has it as its derivative.
        steps = dt / 2 * (momentum[:-1] + momentum[1:])
        steps += dt**2 / 12 * (momentum_rate[:-1] - momentum_rate[1:])
        total = np.vstack((np.zeros(3), np.cumsum(steps, axis=0)))
        derivatives = (
            np.hstack((knots.position, com - com[0], total)),
            dt * np.hstack((knots.velocity, com_rate, momentum)),
            dt**2 * np.hstack((knots.acceleration, com_rate2, momentum_rate)),
        )
        ends = np.stack([d[:-1] for d in derivatives] + [d[1:] for d in derivatives], axis=1)
        self._coefficients = _QUINTIC @ ends
        self._setpoint = Setpoint.at_rest(knots.position[0])

    def sample(self, time: float) -> Setpoint:
        """The set point at ``time`` (s) in [0, T]; the next call overwrites it."""
        last = len(self._coefficients) - 1
        place = min(max(time / self._dt, 0.0), last + 1.0)
        k = min(int(place), last)
        u, dt = place - k, self._dt
        u2, u3 = u * u, u * u * u
        powers = np.array(
            [
                [1.0, u, u2, u3, u2 * u2, u2 * u3],
                [0.0, 1.0 / dt, 2 * u / dt, 3 * u2 / dt, 4 * u3 / dt, 5 * u2 * u2 / dt],
                [0.0, 0.0, 2 / dt**2, 6 * u / dt**2, 12 * u2 / dt**2, 20 * u3 / dt**2],
            ]
        )
        values, rates, accelerations = powers.dot(self._coefficients[k])
        setpoint = self._setpoint
        n = len(setpoint.posture)
        setpoint.posture[:] = values[:n]
        setpoint.posture_velocity[:] = rates[:n]
        setpoint.posture_acceleration[:] = accelerations[:n]
        setpoint.com_position[:] = values[n : n + 3]
        setpoint.com_velocity[:] = rates[n : n + 3]
        setpoint.com_acceleration[:] = accelerations[n : n + 3]
        setpoint.angular_momentum[:] = rates[n + 3 :]
        setpoint.angular_momentum_rate[:] = accelerations[n + 3 :]
        return setpoint


def centroidal(
    kinematics: FeetFixedKinematics, knots: JointKnots
) -> tuple[Array, Array, Array, Array, Array]:
    """CoM and angular momentum about it while the left foot stands still.

    Returns:
        (k, 3) CoM (m), its velocity and acceleration, the angular momentum (kg m^2/s) and its
        rate (Nm); world axes.
    """
    model, data = kinematics.model, kinematics.model.createData()
    q, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    ankle = model.frames[model.getFrameId(kinematics.robot.sole_frames[0])].parentJoint
    world_M_ankle = kinematics.world_M_ankle
    results = []
    for position, velocity, acceleration in zip(
        knots.position, knots.velocity, knots.acceleration, strict=True
    ):
        # The base at the origin; it moves such that the ankle does not.
        q[7:], v[6:], a[6:] = position, velocity, acceleration
        v[:6] = a[:6] = 0.0
        pin.forwardKinematics(model, data, q, v)
        base_M_ankle = data.oMi[ankle].copy()
        v[:6] = -base_M_ankle.act(data.v[ankle]).vector
        pin.forwardKinematics(model, data, q, v, a)
        a[:6] = -base_M_ankle.act(data.a[ankle]).vector
        pin.computeCentroidalMomentumTimeVariation(model, data, q, v, a)
        world_M_base = world_M_ankle * base_M_ankle.inverse()
        R, m = world_M_base.rotation, kinematics.mass
        results.append(
            (
                world_M_base.act(data.com[0]),
                R @ data.hg.linear / m,
                R @ data.dhg.linear / m,
                R @ data.hg.angular,
                R @ data.dhg.angular,
            )
        )
    com, com_rate, com_rate2, momentum, momentum_rate = (
        np.array(values) for values in zip(*results, strict=True)
    )
    return com, com_rate, com_rate2, momentum, momentum_rate
