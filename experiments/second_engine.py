"""Does a result survive another simulator? The same jumps in Drake, beside those in MuJoCo.

    pip install drake==1.51.1
    python -m experiments.second_engine --jobs 2
    python -m experiments.second_engine --jobs 2 --modulus 1e7     # a harder floor

Drake gets masses, joints, friction, gravity and the shapes that touch the ground of each world as it
was drawn. The rest is its own: multibody dynamics, the solver of contacts (SAP), and contacts as pressure over
a patch of a rubber floor, in place of MuJoCo's springs at the corners of the soles. Controllers,
estimators, plans, policies, motors, sensors and metrics are those of the environment, which see Drake's
robot through MuJoCo's arrays.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import (
    AddCompliantHydroelasticPropertiesForHalfSpace,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    HalfSpace,
    ProximityProperties,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    ExternallyAppliedSpatialForce,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
    WeldJoint,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from rich.console import Console

from experiments.seeds import ENGINE
from icub_jump_env.checks import check_count, check_number
from icub_jump_env.config import JumpConfig
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.cli import guarded, parse
from icub_jump_env.evaluation.episodes.rollout import Episode, make_env, run_episode
from icub_jump_env.evaluation.quantities import CM, CONTROLLERS, PERCENT, seeds
from icub_jump_env.evaluation.report.output import new_table, show
from icub_jump_env.evaluation.statistics.difference import Difference, holm_corrected, in_words
from icub_jump_env.policy import BASELINE, Policy, load_policy
from icub_jump_env.robot.mujoco_model import BLOCK_GEOMS, FLOOR_GEOM, sole_geom
from icub_jump_env.robot.robot import Robot
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.versions import VERSIONS

Array = NDArray[np.float64]

RUBBER_THICKNESS = 0.005
"""Of what covers the floor (m)."""
RELAXATION_TIME = 0.005
"""Of the rubber, by which a contact is damped (s), half of it from each shape."""
INFINITE = 1e6
"""A coefficient of friction that leaves the other one's in the harmonic mean."""
MODULUS = 1e6
"""Of the rubber (Pa), unless asked otherwise: under a sole that carries half the robot it gives way by less than 0.1 mm."""
LAW, POLICY = "law, 5 cm, disturbed", "policy, 5 cm, disturbed"


class Twin:
    """A Drake plant of what a MuJoCo model describes.

    Attributes:
        plant: The plant.
        context: Its state.
    """

    def __init__(self, model: mujoco.MjModel, modulus: float) -> None:
        """Build it.

        Args:
            model: What is described.
            modulus: Of what covers the floor (Pa).
        """
        self._modulus = modulus
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(
            time_step=model.opt.timestep,
            contact_model="hydroelastic",
            discrete_contact_approximation="sap",
        )
        self.plant, scene = AddMultibodyPlant(config, builder)
        self.plant.mutable_gravity_field().set_gravity_vector(model.opt.gravity)
        self._bodies = [self.plant.world_body()]
        self._joints: list[RevoluteJoint] = []
        for number in range(1, model.nbody):
            self._bodies.append(self._add_body(model, number))
            self._join(model, number)
        self._shapes = {self._add_shape(model, k): model.geom(k).name for k in _touching(model)}
        self.plant.Finalize()
        of_robot = GeometrySet([key for key, name in self._shapes.items() if name != FLOOR_GEOM])
        scene.collision_filter_manager().Apply(
            CollisionFilterDeclaration().ExcludeWithin(of_robot)
        )
        self._simulator = Simulator(builder.Build())
        self._simulator.Initialize()
        root = self._simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(root)
        base = self._bodies[1]
        start, rate = base.floating_positions_start(), base.floating_velocities_start_in_v()
        self._quaternion, self._position = slice(start, start + 4), slice(start + 4, start + 7)
        self._spin, self._velocity = slice(rate, rate + 3), slice(rate + 3, rate + 6)
        self._angles = [joint.position_start() for joint in self._joints]
        self._rates = [joint.velocity_start() for joint in self._joints]
        self._dt, self._steps = float(model.opt.timestep), 0

    def set_state(self, qpos: Array, qvel: Array) -> None:
        """Take MuJoCo's state."""
        q, v = np.zeros(self.plant.num_positions()), np.zeros(self.plant.num_velocities())
        q[self._quaternion], q[self._position] = qpos[3:7], qpos[:3]
        q[self._angles] = qpos[7:]
        v[self._velocity] = qvel[:3]
        v[self._spin] = RotationMatrix(Quaternion(qpos[3:7])).multiply(qvel[3:6])
        v[self._rates] = qvel[6:]
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, v)

    def state(self) -> tuple[Array, Array]:
        """Positions and velocities, as MuJoCo has them."""
        q = self.plant.GetPositions(self.context)
        v = self.plant.GetVelocities(self.context)
        quaternion = q[self._quaternion] / np.linalg.norm(q[self._quaternion])
        spin = RotationMatrix(Quaternion(quaternion)).inverse().multiply(v[self._spin])
        qpos = np.concatenate((q[self._position], quaternion, q[self._angles]))
        return qpos, np.concatenate((v[self._velocity], spin, v[self._rates]))

    def step(self, torque: Array, body: int, force: Array, at: Array) -> None:
        """Advance by a physics step.

        Args:
            torque: (n,) on the joints (Nm).
            body: Number of the body that is pushed.
            force: (3,) on it (N), world axes.
            at: (3,) where, in its frame (m).
        """
        forces = np.zeros(self.plant.num_velocities())
        forces[self._rates] = torque
        self.plant.get_applied_generalized_force_input_port().FixValue(self.context, forces)
        push = ExternallyAppliedSpatialForce()
        push.body_index = self._bodies[body].index()
        push.p_BoBq_B = at
        push.F_Bq_W = SpatialForce(tau=np.zeros(3), f=force)
        self.plant.get_applied_spatial_force_input_port().FixValue(self.context, [push])
        self._steps += 1
        self._simulator.AdvanceTo(self._steps * self._dt)

    def contacts(self) -> dict[str, tuple[Array, Array]]:
        """Force on each shape of the robot that touched the floor in the last step (N), and where (m)."""
        results = self.plant.get_contact_results_output_port().Eval(self.context)
        found = {}
        for k in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(k)
            surface, force = info.contact_surface(), info.F_Ac_W()
            first, second = self._shapes[surface.id_M()], self._shapes[surface.id_N()]
            on_first = force.translational()
            point = _centre_of_pressure(surface.centroid(), force)
            found.update(
                {second: (-on_first, point)} if first == FLOOR_GEOM else {first: (on_first, point)}
            )
        return found

    def _add_body(self, model: mujoco.MjModel, number: int) -> Any:
        mass, inertia = model.body_mass[number], SpatialInertia.Zero()
        if mass > 0.0:
            axes = _transform(np.zeros(3), model.body_iquat[number]).rotation()
            principal = RotationalInertia(*model.body_inertia[number])
            inertia = SpatialInertia.MakeFromCentralInertia(
                mass, model.body_ipos[number], principal.ReExpress(axes)
            )
        return self.plant.AddRigidBody(model.body(number).name, inertia)

    def _join(self, model: mujoco.MjModel, number: int) -> None:
        parent = self._bodies[model.body_parentid[number]]
        child = self._bodies[number]
        placement = _transform(model.body_pos[number], model.body_quat[number])
        if model.body_jntnum[number] == 0:
            weld = WeldJoint(
                f"{child.name()}_weld", parent.body_frame(), child.body_frame(), placement
            )
            self.plant.AddJoint(weld)
            return
        joint = int(model.body_jntadr[number])
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            return
        name, degree = model.joint(joint).name, int(model.jnt_dofadr[joint])
        anchor = RigidTransform(model.jnt_pos[joint])
        outer = FixedOffsetFrame(f"{name}_outer", parent.body_frame(), placement @ anchor)
        inner = FixedOffsetFrame(f"{name}_inner", child.body_frame(), anchor)
        made = RevoluteJoint(
            name,
            self.plant.AddFrame(outer),
            self.plant.AddFrame(inner),
            model.jnt_axis[joint],
            model.dof_damping[degree],
        )
        made.set_position_limits(*([limit] for limit in model.jnt_range[joint]))
        self._joints.append(self.plant.AddJoint(made))
        rotor = self.plant.AddJointActuator(name, self._joints[-1])
        rotor.set_default_gear_ratio(1.0)
        rotor.set_default_rotor_inertia(model.dof_armature[degree])

    def _add_shape(self, model: mujoco.MjModel, geom: int) -> GeometryId:
        properties, name = ProximityProperties(), model.geom(geom).name
        # MuJoCo takes the larger coefficient of two shapes, Drake 2 a b / (a + b).
        friction = max(model.geom_friction[geom, 0], model.geom(FLOOR_GEOM).friction[0]) / 2.0
        if name == FLOOR_GEOM:
            friction = INFINITE
        AddContactMaterial(friction=CoulombFriction(friction, friction), properties=properties)
        properties.AddProperty("material", "relaxation_time", RELAXATION_TIME / 2.0)
        if name == FLOOR_GEOM:
            AddCompliantHydroelasticPropertiesForHalfSpace(
                RUBBER_THICKNESS, self._modulus, properties
            )
            shape: Any = HalfSpace()
        else:
            AddRigidHydroelasticProperties(properties)
            shape = Box(*(2.0 * model.geom_size[geom]))
        placement = _transform(model.geom_pos[geom], model.geom_quat[geom])
        body = self._bodies[model.geom_bodyid[geom]]
        return self.plant.RegisterCollisionGeometry(body, placement, shape, name, properties)


def _touching(model: mujoco.MjModel) -> NDArray[np.int_]:
    return np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))


def _transform(position: Array, quaternion: Array) -> RigidTransform:
    return RigidTransform(Quaternion(quaternion / np.linalg.norm(quaternion)), position)


def _centre_of_pressure(point: Array, force: SpatialForce) -> Array:
    """Where on the floor a force would act that has no moment about level axes."""
    moment, upward = force.rotational(), force.translational()[2]
    if upward == 0.0:
        return point
    return np.array([point[0] - moment[1] / upward, point[1] + moment[0] / upward, 0.0])


class DrakePhysics(Physics):
    """The world of :class:`Physics`, moved by Drake: MuJoCo's arrays say what came of it.

    Attributes:
        modulus: Of what covers the floor (Pa).
    """

    modulus: float = MODULUS

    def __init__(self, robot: Robot, *arguments: Any, **keywords: Any) -> None:
        super().__init__(robot, *arguments, **keywords)
        self._chest = self.model.body(robot.chest_link).id
        self._floor = self.data.sensor("floor_force").data
        self._soles = {sole_geom(s): self.data.sensor(f"{s}_sole_force").data for s in "lr"}

    def reset(self, qpos: Array) -> None:
        """Put the robot at rest, in the world that was drawn."""
        if set(BLOCK_GEOMS) & {self.model.geom(k).name for k in range(self.model.ngeom)}:
            raise ConfigError("randomization", "blocks", "level ground: Drake's does not change")
        super().reset(qpos)
        self._twin = Twin(self.model, self.modulus)

    def start_from_rest(self) -> None:
        """Stop all motion and set the time to zero."""
        contacts = self._twin.contacts()
        super().start_from_rest()
        self._show(contacts)

    def step(self) -> None:
        """Advance by one physics step."""
        model, data, twin = self.model, self.data, self._twin
        mujoco.mj_forward(model, data)  # what depends on the state at the beginning of the step
        twin.set_state(data.qpos, data.qvel)
        torque = data.actuator_force + self.joint_force
        twin.step(torque, self._chest, self.chest_force, model.body_ipos[self._chest])
        self._show(twin.contacts())
        data.qpos[:], data.qvel[:] = twin.state()
        data.time += model.opt.timestep
        self.note(1)

    def _show(self, contacts: Mapping[str, tuple[Array, Array]]) -> None:
        """Write the forces where MuJoCo's sensors have theirs."""
        for sole, slots in self._soles.items():
            slots[:] = 0.0
            if sole in contacts:
                slots[:] = np.concatenate(([1.0], *contacts[sole]))
        self._floor[0] = len(contacts)
        self._floor[1:4] = sum((force for force, _ in contacts.values()), np.zeros(3))


class DrakeEnv(ICubJumpEnv):
    """The environment, in Drake on a floor of this modulus (Pa); its steps are not compiled."""

    def __init__(self, floor: float = MODULUS, **config: Any) -> None:
        class Engine(DrakePhysics):
            modulus = floor

        self._engine = Engine
        super().__init__(**config | {"physics_loop": "python"})


@dataclass(frozen=True)
class EngineOptions:
    """Jump in two simulators.

    Attributes:
        jobs: Processes that work in parallel.
        episodes: Of each row in each simulator.
        modulus: Of the rubber on Drake's floor (Pa).
    """

    jobs: int = 1
    episodes: int = 100
    modulus: float = MODULUS

    def __post_init__(self) -> None:
        check_count("jobs", self.jobs, 1, unit="processes")
        check_count("episodes", self.episodes, 1, len(ENGINE))
        check_number("modulus", self.modulus, 1e4, 1e9, "Pa")


def rows(controller: str) -> dict[str, tuple[JumpConfig, Policy]]:
    """What is jumped: the paper's command, a plan, and a policy."""
    v1 = VERSIONS["ICubJump-v1"]
    policy = load_policy(f"disturbed-{controller}")
    command = JumpConfig.of(controller=controller, jump_height=0.04, randomization="full")
    plan = JumpConfig.of(**v1, controller=controller, jump_height=0.06, randomization="full")
    felt = policy.card.config.replace(jump_height=0.05, randomization="disturbed")
    return {
        "4 cm commanded, full": (command, BASELINE),
        "plan of 6 cm, full": (plan, BASELINE),
        LAW: (felt, BASELINE),
        POLICY: (felt, policy),
    }


def jump(
    config: JumpConfig, policy: Policy, modulus: float | None, of_seeds: Sequence[int]
) -> list[Episode]:
    """Episodes in Drake, on a floor of this modulus (Pa), or in MuJoCo if it is None."""
    logging.getLogger("drake").setLevel(logging.ERROR)  # it warns of half spaces and soft bodies
    whole = config.replace(early_end=False)
    env = make_env(whole) if modulus is None else DrakeEnv(modulus, **vars(whole))
    return [run_episode(env, seed, policy) for seed in of_seeds]


def cells(ours: Sequence[Episode], theirs: Sequence[Episode]) -> list[str]:
    """Success and rise in MuJoCo and in Drake, and what Drake adds."""
    added = Difference.of(theirs, ours)
    points, low, high = (PERCENT * value for value in (added.success, *added.success_interval))
    shares = (f"{PERCENT * np.mean([e.is_success for e in es]):.0f}" for es in (ours, theirs))
    rises = (f"{CM * np.mean([e.jump['flight_height'] for e in es]):.2f}" for es in (ours, theirs))
    rise, least, most = (CM * value for value in (added.rise, *added.rise_interval))
    return [
        *shares, f"{points:+z.1f} ({low:+z.1f} to {high:+z.1f})",
        *rises, f"{rise:+z.2f} ({least:+z.2f} to {most:+z.2f})",
    ]  # fmt: skip


def run(options: EngineOptions) -> None:
    """Jump and print."""
    chosen = ENGINE[: options.episodes]
    floor = "" if options.modulus == MODULUS else f", floor of {options.modulus:.0e} Pa"
    table = new_table(
        2, "controller", "jump", "MuJoCo, %", "Drake, %", "difference", "MuJoCo, cm", "Drake, cm",
        "difference", title=f"Success and rise in two simulators, {seeds(chosen)}{floor}",
    )  # fmt: skip
    parts = [chosen[k :: options.jobs] for k in range(options.jobs)]
    compared: dict[str, Difference] = {}
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool:
        for controller in CONTROLLERS:
            done: dict[str, list[list[Episode]]] = {}
            for name, (config, policy) in rows(controller).items():
                done[name] = []
                for modulus in (None, options.modulus):
                    work = [pool.submit(jump, config, policy, modulus, part) for part in parts]
                    every = [episode for part in work for episode in part.result()]
                    done[name].append(sorted(every, key=lambda episode: episode.seed))
                table.add_row(controller, name, *cells(*done[name]))
            for simulator, policy_s, law_s in zip(
                ("MuJoCo", "Drake"), done[POLICY], done[LAW], strict=True
            ):
                compared[f"{controller}, {simulator}, policy against law"] = Difference.of(
                    policy_s, law_s
                )
    console = Console()
    show(console, table)
    corrected = holm_corrected(list(compared.values()))
    for line in in_words(dict(zip(compared, corrected, strict=True))):
        console.print(line, soft_wrap=True, highlight=False)


if __name__ == "__main__":
    guarded(lambda: run(parse(EngineOptions, sys.argv[1:])))
