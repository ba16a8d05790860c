"""The true state, read from MuJoCo after each physics step."""

from __future__ import annotations

import math

from icub_jump_env.compiled import compiled
from icub_jump_env.metrics.state import TrueState
from icub_jump_env.records import Array, Block, Number, Record
from icub_jump_env.robot.mujoco_model import sole_geom
from icub_jump_env.simulation.physics import Physics


class Addresses(Record):
    """Where the true state stands in MuJoCo's arrays.

    Attributes:
        com, com_velocity, angular_momentum, joint_position, joint_velocity, floor, left_sole,
            right_sole: First entries in ``sensordata``; of the last three, of contacts.
        base, chest: Numbers of the bodies.
        left_geom, right_geom: Numbers of the soles' geometries.
    """

    com: Number
    com_velocity: Number
    angular_momentum: Number
    joint_position: Number
    joint_velocity: Number
    floor: Number
    left_sole: Number
    right_sole: Number
    base: Number
    chest: Number
    left_geom: Number
    right_geom: Number


class GroundTruth:
    """Keeps one :class:`TrueState` up to date with the physics.

    ``mj_step`` evaluates positions, velocities and forces at the beginning of the step
    and then integrates. All entries are those of that instant, so that heights,
    momenta and forces belong together.

    Attributes:
        state: The true state.
        sources: What :func:`read_truth` reads: MuJoCo's arrays, and where in them.
    """

    def __init__(self, physics: Physics) -> None:
        self._physics = physics
        robot, model, data = physics.robot, physics.model, physics.data
        first = robot.joint_names[0]
        sensors = {
            "com": "com",
            "com_velocity": "com_velocity",
            "angular_momentum": "angular_momentum",
            "joint_position": f"{first}_position",
            "joint_velocity": f"{first}_velocity",
            "floor": "floor_force",
            "left_sole": "l_sole_force",
            "right_sole": "r_sole_force",
        }
        addresses = Addresses(
            **{name: model.sensor(sensor).adr[0] for name, sensor in sensors.items()},
            base=model.body(robot.base_link).id,
            chest=model.body(robot.chest_link).id,
            left_geom=model.geom(sole_geom("l")).id,
            right_geom=model.geom(sole_geom("r")).id,
        )
        self.state = TrueState(robot.n_joints)
        self.sources = (
            data.sensordata, data.actuator_force, data.xmat, data.geom_xpos, data.geom_xmat,
            model.geom_size, data.crb, addresses.block,
        )  # fmt: skip

    def __reduce__(self) -> tuple[type[GroundTruth], tuple[Physics]]:
        # Views of MuJoCo's arrays have to be taken anew from a copy's own data.
        return GroundTruth, (self._physics,)

    def read(self) -> TrueState:
        """Update the state after a physics step."""
        read_truth(self._physics.evaluated_time, self.state.block, *self.sources)
        return self.state


@compiled
def read_truth(
    time: float,
    state: Block,
    sensordata: Array,
    actuator_force: Array,
    xmat: Array,
    geom_xpos: Array,
    geom_xmat: Array,
    geom_size: Array,
    crb: Array,
    addresses: Block,
) -> None:
    """Read the true state.

    Args:
        time: For which MuJoCo last evaluated all (s).
        state: Block of the :class:`icub_jump_env.metrics.state.TrueState`, which this fills.
        sensordata: MuJoCo's.
        actuator_force: Likewise.
        xmat: Orientations of bodies.
        geom_xpos: Positions of geometries.
        geom_xmat: Their orientations.
        geom_size: Their half sizes.
        crb: Composite inertias.
        addresses: Block of the :class:`Addresses`.
    """
    a, s = addresses[0], state[0]
    s.time = time
    com, velocity, momentum = int(a.com), int(a.com_velocity), int(a.angular_momentum)
    for i in range(3):
        s.com[i] = sensordata[com + i]
        s.com_velocity[i] = sensordata[velocity + i]
        s.angular_momentum[i] = sensordata[momentum + i]
        # The chest's up axis is the y axis of its link frame.
        s.chest_up[i] = xmat[int(a.chest), 3 * i + 1]
    position, rate = int(a.joint_position), int(a.joint_velocity)
    for j in range(s.joint_position.shape[0]):
        s.joint_position[j] = sensordata[position + j]
        s.joint_velocity[j] = sensordata[rate + j]
        s.joint_torque[j] = actuator_force[j]
    # MuJoCo reports the force of the first geom, the floor, on the robot.
    floor = int(a.floor)
    s.ground_force = sensordata[floor + 3]
    of_soles = sensordata[int(a.left_sole)] + sensordata[int(a.right_sole)]
    s.only_feet_touch = 1.0 if sensordata[floor] == of_soles else 0.0
    lowest = math.inf
    for foot in range(2):
        geom = int(a.left_geom) if foot == 0 else int(a.right_geom)
        corner = geom_xpos[geom, 2]
        for i in range(3):
            s.sole_position[foot, i] = geom_xpos[geom, i]
            corner -= abs(geom_xmat[geom, 6 + i]) * geom_size[geom, i]
        lowest = min(lowest, corner)
    s.sole_height = lowest
    s.base_pitch = math.asin(min(1.0, max(-1.0, xmat[int(a.base), 6])))
    # Body 1 heads the kinematic tree: its composite inertia is about the CoM.
    xx, yy, zz, xy, xz, yz = crb[1, 0], crb[1, 1], crb[1, 2], crb[1, 3], crb[1, 4], crb[1, 5]
    inertia = s.locked_inertia
    inertia[0, 0], inertia[1, 1], inertia[2, 2] = xx, yy, zz
    inertia[0, 1] = inertia[1, 0] = xy
    inertia[0, 2] = inertia[2, 0] = xz
    inertia[1, 2] = inertia[2, 1] = yz
