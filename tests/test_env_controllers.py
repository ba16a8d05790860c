"""Robots, controllers and how the launch ends: what an environment makes of their settings."""

import dataclasses
import itertools

import gymnasium
import numpy as np
import pytest
from conftest import ZERO, jump, rollout

from icub_jump_env import PhaseConfig, TorqueConfig, VelocityConfig
from icub_jump_env.control.phases import Phase
from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.robot.frames import mujoco_qpos

ROBOTS = ("iCubGenova04", "iCubGenova02", "iCubGenova01")


def tracking(env):
    """The controller of the launch."""
    return env._controller._controllers[Phase.LAUNCH]._controller


class TestRobots:
    @pytest.mark.parametrize("controller", ["velocity", "torque"])
    @pytest.mark.parametrize("robot", ROBOTS)
    def test_the_nominal_jump_lands(self, robot, controller):
        episode = jump(robot=robot, controller=controller, stand_time=0.3)
        assert episode.outcome == "stood"
        assert episode.is_success
        assert episode.jump["flight_height"] > 0.033
        assert episode.jump["solver_failures"] == episode.jump["limit_violations"] == 0.0

    def test_make_takes_a_robot_and_they_differ(self):
        observations = []
        for robot in ROBOTS:
            env = gymnasium.make("ICubJump-v0", robot=robot)
            assert env.unwrapped.robot.name == env.unwrapped.config.robot == robot
            observations.append(env.reset(seed=0)[0])
            observations[-1] = env.step(ZERO)[0]
        assert len({obs.tobytes() for obs in observations}) == 3

    @pytest.mark.parametrize("robot", ROBOTS)
    def test_starts_with_the_soles_on_the_floor(self, robot):
        """Neither a drop nor a push out of the floor: the soles rest where they are put."""
        env = ICubJumpEnv(robot=robot)
        env.reset(seed=0)
        weight = 9.81 * env.model.body_mass.sum()
        assert env.data.sensor("floor_force").data[3] == pytest.approx(weight, rel=1e-3)
        crouch = mujoco_qpos(env._controller.plan.stance.configuration)
        assert abs(env.data.qpos[2] - crouch[2]) < 1e-3
        assert env._simulation.truth.read().sole_height == pytest.approx(0.0, abs=1e-3)
        env._simulation.physics.reset(crouch)
        # The right foot follows from the legs, which the URDF has not quite symmetric.
        assert env._simulation.truth.read().sole_height == pytest.approx(0.0, abs=2e-4)


class TestHardConstraints:
    @pytest.mark.parametrize(("controller", "equalities"), [("velocity", 12), ("torque", 18)])
    def test_the_nominal_jump_stands_and_the_paper_equations_hold_where_they_can(
        self, controller, equalities
    ):
        """To 1e-6 at each tick that has a solution; the others are counted."""
        env = ICubJumpEnv(
            controller=controller, constraints="hard", stand_time=0.3,
            agent_frequency={"velocity": 200.0, "torque": 500.0}[controller],
        )  # fmt: skip
        env.reset(seed=0)
        subject, problem = tracking(env), tracking(env).qp.problem
        assert problem.n_equalities == equalities
        solved, failed, terminated = 0, 0, False
        while not terminated:
            _, _, terminated, _, info = env.step(ZERO)
            if info["phase"] != "launch" or info["solver_status"] == "idle":
                continue
            if info["solver_status"] != "solved":
                failed += 1
                continue
            solved += 1
            applied = subject._terms.previous if controller == "velocity" else subject.solution
            residual = problem.C @ applied - problem.lower[problem.n :]
            assert np.abs(residual[-equalities:]).max() <= 1e-6
        assert info["outcome"] == "stood"
        assert info["is_success"]
        assert info["jump"]["solver_failures"] == failed
        assert info["jump"]["limit_violations"] == 0.0
        assert failed <= 0.05 * solved
        env.close()

    @pytest.mark.parametrize("controller", ["velocity", "torque"])
    def test_it_is_another_jump_than_the_soft_one(self, controller):
        hard, soft = (
            jump(controller=controller, constraints=name, stand_time=0.1)
            for name in ("hard", "soft")
        )
        assert hard.jump["flight_height"] != soft.jump["flight_height"]
        expected = pytest.approx(soft.jump["flight_height"], abs=4e-3)
        assert hard.jump["flight_height"] == expected


class TestLaunchEnd:
    def launch(self, launch_end):
        env = ICubJumpEnv(launch_end=launch_end, agent_frequency=200.0, stand_time=0.1)
        env.reset(seed=0)
        snapshots, terminated = [], False
        while not terminated:
            *_, terminated, _, info = env.step(ZERO)
            # MuJoCo's forces are those of a millisecond before.
            snapshots.append(dataclasses.replace(env.snapshot(), time=env.data.time))
        return [s for s in snapshots if s.phase == "launch"], env._controller.plan.duration, info

    def test_at_lift_off_alone_the_launch_goes_on_until_contact_is_lost(self):
        launch, duration, info = self.launch("lift_off")
        assert info["outcome"] == "stood"
        assert launch[-1].time > duration + 0.01
        # The tick after the second reading below 10 N in a row begins the flight.
        unloaded = [s.ground_force < 10.0 for s in launch]
        assert unloaded[-3:] == [False, True, True]
        assert not any(a and b for a, b in itertools.pairwise(unloaded[:-1]))

    def test_by_default_it_ends_at_T(self):
        launch, duration, _ = self.launch("time")
        assert duration <= launch[-1].time < duration + 0.005

    def test_after_T_the_reference_falls_freely(self):
        launch, duration, _ = self.launch("lift_off")
        late = [s for s in launch if s.time > duration]
        heights = np.array([s.com_reference[2] for s in late])
        acceleration = np.diff(heights, 2) / 0.005**2
        np.testing.assert_allclose(acceleration, -9.81, atol=1e-6)
        rise = heights[0] - launch[0].com_reference[2]
        fall = late[0].time - duration
        speed = np.sqrt(2 * 9.81 * 0.04)
        assert rise == pytest.approx(0.11 + speed * fall - 9.81 * fall**2 / 2, abs=1e-5)


class TestSettings:
    def test_gains_reach_the_qp(self):
        """Given as they are and as the plain mapping of a file."""
        first = []
        for controller in (
            "torque",
            TorqueConfig(com_stiffness=100.0, posture_weight=(2.0, 1.0, 1.0)),
            {"kind": "torque", "com_stiffness": 100.0, "posture_weight": [2.0, 1.0, 1.0]},
        ):
            env = gymnasium.make("ICubJump-v0", controller=controller).unwrapped
            env.reset(seed=0)
            env.step(np.ones(3, np.float32))
            problem = tracking(env).qp.problem
            first.append((problem.H.copy(), problem.g.copy()))
        for default, given, mapped in zip(*first, strict=True):
            np.testing.assert_array_equal(given, mapped)
            assert not np.array_equal(default, given)

    @pytest.mark.parametrize(
        "weights", [(3.0, 2.0, 1.0), (*[3.0] * 12, *[2.0] * 3, *[1.0] * 8)], ids=["group", "joint"]
    )
    def test_weights_per_group_and_per_joint_are_the_same_thing(self, weights):
        env = gymnasium.make(
            "ICubJump-v0",
            controller=VelocityConfig(
                posture_weight=weights, smoothness_weight=weights, momentum_control=False,
                com_weight=0.0,
            ),
        ).unwrapped  # fmt: skip
        env.reset(seed=0)
        env.step(ZERO)
        expected = 2 * np.array([3.0] * 12 + [2.0] * 3 + [1.0] * 8)
        np.testing.assert_allclose(tracking(env).qp.problem.H, np.diag(expected))

    def test_a_wrong_number_of_weights_is_refused(self):
        with pytest.raises(ValueError, match=r"posture_weight=.* 3 weights .* or 23"):
            gymnasium.make("ICubJump-v0", controller=VelocityConfig(posture_weight=(1.0,) * 4))

    def test_phases_reach_the_phase_machine(self):
        """A foot that bears half the weight has lifted off."""
        phases = PhaseConfig(lift_off=1e4, touch_down=1e4, lift_off_ticks=3)
        env = gymnasium.make(
            "ICubJump-v0", controller=VelocityConfig(phases=phases), agent_frequency=200.0
        )
        env.reset(seed=0)
        assert [env.step(ZERO)[4]["phase"] for _ in range(3)] == ["launch", "launch", "flight"]

    def test_reward_weights_scale_their_terms(self):
        terms = {}
        given = {"landed": 3.0, "height": 5.0, "rotation": 7.0, "residual": 0.5}
        action = np.full(3, 0.1, np.float32)
        for name, reward in (("default", {}), ("given", given)):
            env = gymnasium.make("ICubJump-v0", stand_time=0.1, reward=reward)
            *_, terms[name] = rollout(env, lambda rng: action)
        default, scaled = terms["default"], terms["given"]
        assert default["reward_height"] > 0.5
        assert scaled["reward_landed"] == 3.0 * default["reward_landed"] == 3.0
        assert scaled["reward_height"] == pytest.approx(2.5 * default["reward_height"])
        assert scaled["reward_rotation"] == pytest.approx(7.0 * default["reward_rotation"])
        assert -1.0 < scaled["reward_rotation"] < 0.0
        early = gymnasium.make("ICubJump-v0", reward=given)
        early.reset(seed=0)
        assert early.step(action)[1] == pytest.approx(-0.5 * float(action @ action))

    @pytest.mark.parametrize(
        ("success", "reached"),
        [
            ({}, True),
            ({"height_ratio": 1.2}, False),
            ({"flight_time": 0.3}, False),
            ({"height_ratio": 0.0, "flight_time": 0.0}, True),
        ],
    )
    def test_success_is_what_it_is_configured_to_be(self, success, reached):
        env = gymnasium.make("ICubJump-v0", success={"stand_time": 0.1, **success})
        *_, info = rollout(env)
        assert info["outcome"] == "stood"
        assert info["is_success"] is reached

    def test_the_shortcut_of_the_stand_time_is_that_of_success(self):
        ends = []
        for given in ({"stand_time": 0.2}, {"success": {"stand_time": 0.2}}, {"stand_time": 0.1}):
            *_, info = rollout(gymnasium.make("ICubJump-v0", **given))
            ends.append(info["time"])
        assert ends[0] == ends[1] == pytest.approx(ends[2] + 0.1, abs=0.011)

    def test_a_faster_residual_is_further_after_the_same_time(self):
        shifts = []
        for bandwidth in (5.0, 15.0):
            env = ICubJumpEnv(residual={"bandwidth": bandwidth})
            env.reset(seed=0)
            for _ in range(10):
                env.step(np.array([0.3, 0.0, 0.0], np.float32))
            shifts.append(env._controller.residual.offset[0])
        assert shifts[1] > 3 * shifts[0] > 0.0
