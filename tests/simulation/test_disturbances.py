"""Disturbances on the way: pushes, the spin, another ground; when they come and what they do."""

import copy
import dataclasses
import math
import pickle

import numpy as np
import pytest
from conftest import ZERO

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation import cli
from icub_jump_env.evaluation.episodes.rollout import make_env, planned
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.robot.frames import mujoco_qpos
from icub_jump_env.robot.mujoco_model import BLOCK_GEOMS, FLOOR_GEOM, sole_geom
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.simulation import disturbances
from icub_jump_env.simulation.disturbances import PUSH_DURATION, Disturbances, ground_rotation
from icub_jump_env.simulation.ground_truth import GroundTruth
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.simulation.randomization import RANDOMIZATIONS, Randomization, draw_world
from icub_jump_env.simulation.sensor_models import SensorConfig
from icub_jump_env.simulation.sensors import Sensors
from icub_jump_env.simulation.variation import ModelVariation

ROBOT = load_robot()
NOMINAL = draw_world(Randomization(), ROBOT, 1, np.random.default_rng(0))
CROUCH = mujoco_qpos(planned(JumpConfig()).stance.configuration)


class Throw:
    """The robot in its crouch, thrown up from 1 cm above the floor; its servos hold the joints."""

    def __init__(self, speed=0.2, **world):
        self.physics = Physics(ROBOT, 0.001, blocks=True)
        self.truth = GroundTruth(self.physics)
        self.physics.reset(CROUCH + 0.01 * (np.arange(30) == 2))
        self.physics.data.qvel[2] = speed
        world = dataclasses.replace(NOMINAL, **world)
        self.disturbances = Disturbances(self.physics, world, launch_duration=0.43)

    def step(self):
        physics, awaited = self.physics, self.disturbances.awaited.block
        if disturbances.comes(physics.data.sensordata, awaited):
            self.disturbances.happen()
        disturbances.push(physics.data.time, awaited, physics.chest_force)
        q, v = physics.joint_position, physics.joint_velocity
        physics.control[:] = 1500.0 * (CROUCH[7:] - q) - 50.0 * v
        physics.step()
        return self.truth.read()

    def until(self, stage):
        for _ in range(300):
            if self.disturbances.awaited.stage == stage:
                return
            self.step()
        raise AssertionError(stage)

    def land(self, steps=300):
        self.until(disturbances.NONE)
        for _ in range(steps):
            self.step()
        return self.truth.state

    def momentum(self):
        return self.physics.model.body_subtreemass[1] * self.truth.state.com_velocity.copy()


class TestPushes:
    @pytest.mark.parametrize("direction", [0.0, math.pi / 2, -2.5])
    @pytest.mark.parametrize("kind", ["push", "flight_push", "landing_push"])
    def test_momentum_gained_in_free_flight_is_the_impulse(self, kind, direction):
        """Beside an undisturbed twin, from the event on; both are lifted off the ground."""
        impulse, delay = -3.0, 0.02
        world = {kind: impulse, f"{kind}_direction": direction, f"{kind}_time": delay}
        if kind == "push":
            world["push_time"] = delay / (0.43 - PUSH_DURATION)
        event = {
            "push": disturbances.LIFT_OFF,
            "flight_push": disturbances.APEX,
            "landing_push": disturbances.NONE,
        }
        calm, pushed = Throw(takeoff_spin=1e-9), Throw(takeoff_spin=1e-9, **world)
        for throw in (calm, pushed):
            throw.until(event[kind])
            throw.physics.data.qpos[2] += 1.0
        gained = []
        for _ in range(80):
            calm.step()
            pushed.step()
            gained.append(pushed.momentum() - calm.momentum())
        expected = impulse * np.array([math.cos(direction), math.sin(direction), 0.0])
        np.testing.assert_allclose(gained[-1], expected, atol=0.01)
        np.testing.assert_array_equal(gained[round(1000 * delay) - 2], 0.0)
        half = round(1000 * (delay + PUSH_DURATION / 2))
        np.testing.assert_allclose(gained[half], expected / 2, atol=0.1)
        np.testing.assert_allclose(gained[half + 27], expected, atol=0.01)

    def test_a_push_acts_for_50_steps_whenever_it_begins(self):
        """Rounding makes it neither shorter nor longer."""
        for delay in 0.001 * np.arange(20):
            throw, steps = Throw(flight_push=1.0, flight_push_time=delay), 0
            throw.physics.data.time = 0.97  # the grid of floats widens at 1
            for _ in range(80):
                throw.step()
                steps += throw.physics.chest_force[0] == 20.0
            assert steps == 50

    def test_pushes_at_the_same_time_add_up(self):
        throw = Throw(push=1.0, push_time=0.0, flight_push=1.0, flight_push_direction=math.pi / 2)
        for _ in range(40):
            throw.step()
        np.testing.assert_allclose(throw.physics.chest_force, [20.0, 20.0, 0.0])


class TestSpin:
    def test_it_turns_the_robot_as_a_whole_about_its_com(self):
        calm, spun = Throw(floor_tilt=1e-9), Throw(takeoff_spin=1.5)
        for throw in (calm, spun):
            throw.until(disturbances.APEX)
        before, after = calm.truth.state, spun.truth.state
        gained = after.angular_momentum - before.angular_momentum
        np.testing.assert_allclose(gained, before.locked_inertia @ [0, 1.5, 0], atol=1e-9)
        np.testing.assert_allclose(after.com_velocity, before.com_velocity, atol=1e-12)
        np.testing.assert_array_equal(after.joint_velocity, before.joint_velocity)
        np.testing.assert_array_equal(after.com, before.com)

    def test_it_comes_once(self):
        """A bounce after the landing is no lift-off."""
        throw = Throw(takeoff_spin=0.2)
        throw.land()
        throw.physics.data.qpos[2] += 0.5
        throw.physics.data.qvel[:] = 0.0
        throw.physics.data.qvel[2] = 1.0
        for _ in range(50):
            throw.step()
        np.testing.assert_allclose(throw.truth.state.angular_momentum, 0.0, atol=0.05)

    def test_chatter_is_no_lift_off(self):
        throw = Throw(takeoff_spin=1.0)
        awaited, sensed = throw.disturbances.awaited, np.zeros(len(throw.physics.data.sensordata))

        def comes(force, rise):
            sensed[[int(awaited.ground_force), int(awaited.rise)]] = force, rise
            return disturbances.comes(sensed, awaited.block)

        for force, rise, steps in ((0.0, 1.0, 4), (1.0, 1.0, 1), (0.9, 1.0, 4), (0.0, -0.1, 1)):
            assert not any(comes(force, rise) for _ in range(steps))
        assert [comes(0.9, 0.1) for _ in range(5)] == [False] * 4 + [True]
        assert not throw.physics.data.qvel[3:].any()
        throw.disturbances.happen()
        assert throw.physics.data.qvel[3:].any()


class TestFloor:
    @pytest.mark.parametrize(("tilt", "lateral"), [(0.03, 0.0), (0.0, -0.04), (-0.03, 0.02)])
    def test_soles_stand_on_the_tilted_plane(self, tilt, lateral):
        throw = Throw(floor_tilt=tilt, floor_tilt_lateral=lateral)
        throw.until(disturbances.TOUCHDOWN)
        pivot = sum(throw.truth.state.sole_position) / 2 * [1, 1, 0]
        state = throw.land(steps=1200)
        normal = ground_rotation(tilt, lateral).apply([0.0, 0.0, 1.0])
        assert np.sign(normal[:2]).tolist() == [-np.sign(tilt), -np.sign(lateral)]
        data = throw.physics.data
        assert data.ncon == 8
        for contact in data.contact:
            np.testing.assert_allclose(contact.frame[:3], normal, atol=1e-12)
            assert abs((contact.pos - pivot) @ normal) < 1e-3
            # Uphill: the floor is higher where x, or y, is larger.
            height = math.tan(tilt) * (contact.pos[0] - pivot[0])
            height += math.tan(lateral) / math.cos(tilt) * (contact.pos[1] - pivot[1])
            assert contact.pos[2] == pytest.approx(height, abs=1e-3)
        for side in "lr":
            up = data.geom(sole_geom(side)).xmat.reshape(3, 3)[:, 2]
            np.testing.assert_allclose(up, normal, atol=0.005)
        assert state.ground_force == pytest.approx(324.3, rel=0.02)
        assert state.only_feet_touch

    def test_nothing_changes_before_the_apex(self):
        throw = Throw(floor_tilt=0.05, step=0.01)
        model, fresh = throw.physics.model, Physics(ROBOT, 0.001, blocks=True).model
        throw.until(disturbances.APEX)
        np.testing.assert_array_equal(model.geom_pos, fresh.geom_pos)
        assert model.opt.disableflags == fresh.opt.disableflags

    def test_the_next_world_finds_it_level(self):
        """MuJoCo leaves out the pose of a geometry that coincides with its body."""
        throw = Throw(floor_tilt=0.05, step=0.01, edge=0.01)
        model, fresh = throw.physics.model, Physics(ROBOT, 0.001, blocks=True).model
        variation = ModelVariation(model, ROBOT)
        throw.land()
        for geom in map(model.geom, (FLOOR_GEOM, *BLOCK_GEOMS)):
            assert not np.array_equal(geom.quat, [1, 0, 0, 0])
            assert geom.sameframe == 0
        variation.apply(NOMINAL, model)
        for name in ("geom_pos", "geom_quat", "geom_sameframe"):
            np.testing.assert_array_equal(getattr(model, name), getattr(fresh, name))
        assert model.opt.disableflags == fresh.opt.disableflags


class TestBlocks:
    def test_the_left_sole_stands_on_the_step(self):
        throw = Throw(step=0.008)
        sensors = Sensors(throw.physics, SensorConfig())
        state = throw.land()
        left, right = (position[2] - 0.004 for position in state.sole_position)
        assert left == pytest.approx(0.008, abs=0.002)
        assert right == pytest.approx(0.0, abs=0.002)
        model = throw.physics.model
        pairs = {tuple(pair) for pair in throw.physics.data.contact.geom}
        ground = {"l": "step", "r": FLOOR_GEOM}
        assert pairs == {
            (model.geom(geom).id, model.geom(sole_geom(side)).id) for side, geom in ground.items()
        }
        forces = sensors.read().foot_force
        assert (forces > 50.0).all()
        assert forces.sum() == pytest.approx(324.3, rel=0.05)
        assert state.ground_force == pytest.approx(forces.sum())
        assert state.only_feet_touch

    @pytest.mark.parametrize(("edge", "step"), [(0.006, 0.0), (-0.006, 0.0), (0.004, 0.004)])
    def test_the_edge_begins_ahead_of_or_behind_the_middle_of_the_left_sole(self, edge, step):
        throw = Throw(edge=edge, step=step)
        throw.until(disturbances.TOUCHDOWN)
        middle = throw.truth.state.sole_position[0][0]
        seen, data = [], throw.physics.data
        for _ in range(100):
            throw.step()
            seen += [c.pos.copy() for c in data.contact if c.geom[0] == data.geom("edge").id]
        x, y, z = np.array(seen).T
        assert np.abs(np.sign(edge) * (x - middle) - 0.02).min() < 0.002
        assert (np.sign(edge) * (x - middle) > 0.018).all()
        assert (y > 0.0).all()
        assert z.max() == pytest.approx(abs(edge) + step, abs=0.001)

    def test_friction_is_that_of_the_world(self):
        throw = Throw(step=0.008)
        variation = ModelVariation(throw.physics.model, ROBOT)
        variation.apply(dataclasses.replace(NOMINAL, friction=0.5), throw.physics.model)
        throw.land()
        assert {contact.friction[0] for contact in throw.physics.data.contact} == {0.5}

    def test_other_links_fall_on_them_too(self):
        throw = Throw(step=0.01)
        throw.land()
        throw.physics.reset(CROUCH)
        throw.physics.data.qpos[:7] = 0.0, 0.3, 0.3, math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0
        assert all(throw.step().only_feet_touch for _ in range(3))
        for _ in range(400):
            throw.step()
        assert not throw.truth.state.only_feet_touch

    def test_only_worlds_that_can_have_them_do(self):
        geoms = [
            make_env(JumpConfig(randomization=Randomization(**ranges))).model.ngeom
            for ranges in ({}, {"floor_tilt": (0.0, 0.1)}, {"step": (0.0, 0.01)})
        ]
        assert geoms[0] == geoms[1] == geoms[2] - len(BLOCK_GEOMS)
        assert not any(ranges.blocks for ranges in RANDOMIZATIONS.values())


EVERYTHING = JumpConfig.of(
    stand_time=0.3,
    randomization=Randomization(
        takeoff_spin=(0.2, 0.4), flight_push=(1.0, 2.0), flight_push_direction=(-1.0, 1.0),
        floor_tilt=(0.01, 0.02), step=(0.002, 0.005), edge=(-0.005, -0.002),
        landing_push=(1.0, 2.0), landing_push_time=(0.0, 0.1),
    ),
)  # fmt: skip


class TestEpisodes:
    def test_nothing_is_awaited_in_an_undisturbed_world(self):
        awaited = Disturbances(Physics(ROBOT, 0.001), NOMINAL, 0.43).awaited
        assert awaited.stage == disturbances.NONE
        assert not awaited.pushes.any()

    def test_copies_go_on_with_the_same_bits_and_so_does_the_next_episode(self):
        """Copies are taken while the robot rises, falls and stands."""
        env = make_env(EVERYTHING)
        starts = []
        for _ in range(2):
            env.reset(seed=1)
            for _ in range(45):
                env.step(ZERO)
            starts.append(env.data.qpos.copy())
        np.testing.assert_array_equal(*starts)
        copies = []
        for steps, stage, copier in (
            (0, disturbances.APEX, copy.deepcopy),
            (9, disturbances.TOUCHDOWN, lambda env: pickle.loads(pickle.dumps(env))),
            (11, disturbances.NONE, copy.deepcopy),
        ):
            for twin in (env, *copies):
                for _ in range(steps):
                    twin.step(ZERO)
            assert env._simulation._disturbances.awaited.stage == stage
            copies.append(copier(env))
        for _ in range(15):
            results = [twin.step(ZERO) for twin in (env, *copies)]
        for twin, result in zip(copies, results[1:], strict=True):
            np.testing.assert_array_equal(twin.data.qpos, env.data.qpos)
            assert str(result[4]) == str(results[0][4])

    def test_until_the_apex_the_jump_is_the_undisturbed_one(self):
        ranges = Randomization(floor_tilt=(0.05, 0.05), step=(0.01, 0.01))
        envs = [make_env(JumpConfig()), make_env(JumpConfig(randomization=ranges))]
        for env in envs:
            env.reset(seed=0)
            for _ in range(52):
                env.step(ZERO)
        np.testing.assert_array_equal(envs[0].data.qpos, envs[1].data.qpos)
        np.testing.assert_array_equal(envs[0].data.qvel, envs[1].data.qvel)
        for env in envs:
            for _ in range(13):
                env.step(ZERO)
        assert not np.array_equal(envs[0].data.qpos, envs[1].data.qpos)

    def test_a_lateral_slope_shows_in_the_imu(self):
        env = make_env(JumpConfig(randomization=Randomization(lateral_slope=(0.03, 0.03))))
        env.reset(seed=0)
        gravity = env._simulation.sensors.readings.gravity
        assert math.atan2(-gravity[1], -gravity[2]) == pytest.approx(0.03, abs=5e-3)

    def test_the_command_line_takes_ranges_and_the_preset(self):
        ranges = cli.parse(EvalOptions, ["--randomization", '{"floor_tilt": [0.05, 0.05]}'])
        assert ranges.config.randomization == Randomization(floor_tilt=(0.05, 0.05))
        preset = cli.parse(EvalOptions, ["--randomization", "disturbed"])
        assert preset.config.randomization_config is RANDOMIZATIONS["disturbed"]
