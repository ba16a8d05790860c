"""The environment with real actuators and sensors, delays and randomised worlds."""

import dataclasses
import json

import gymnasium
import numpy as np
import pytest
from conftest import HARD, ZERO, jump
from gymnasium.utils.env_checker import check_env

from icub_jump_env.config import JumpConfig
from icub_jump_env.control.command import JointCommand
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.simulation.actuators.config import ACTUATORS, FRICTION, ActuatorConfig
from icub_jump_env.simulation.actuators.torque_loops import TorqueFeedback
from icub_jump_env.simulation.disturbances import PUSH_DURATION
from icub_jump_env.simulation.randomization import Randomization
from icub_jump_env.simulation.sensor_models import SENSORS, SensorConfig, SensorError

ROBOT = load_robot()


def test_checker_passes_with_everything_on():
    check_env(gymnasium.make("ICubJump-v0", **HARD).unwrapped, skip_render_check=True)


def test_robots_are_at_rest_after_a_reset():
    env = gymnasium.make("ICubJump-v0", randomization="hard").unwrapped
    for seed in range(3):
        env.reset(seed=seed)
        assert not env.data.qvel.any()


def test_naming_the_ideal_models_changes_nothing(nominal):
    explicit = jump(
        actuators=ActuatorConfig(),
        sensors=SensorConfig(),
        randomization=Randomization(),
        command_delay=0,
    )
    assert explicit.jump == nominal.jump


class TestInfo:
    def test_reset_tells_what_was_drawn(self):
        env = gymnasium.make("ICubJump-v0", randomization="hard")
        world = env.reset(seed=0)[1]["world"]
        assert set(world) == {f.name for f in dataclasses.fields(Randomization)} | {"push_time"}
        assert 0.4 <= world["friction"] <= 1.0
        assert json.loads(json.dumps(world))["delay"] == world["delay"]

    def test_vector_environments_pass_it_on(self):
        envs = gymnasium.make_vec("ICubJump-v0", num_envs=2, randomization="full")
        _, info = envs.reset(seed=[1, 2])
        single = [
            gymnasium.make("ICubJump-v0", randomization="full").reset(seed=seed)[1]["world"]
            for seed in (1, 2)
        ]
        np.testing.assert_array_equal(
            info["world"]["friction"], [world["friction"] for world in single]
        )
        envs.close()


class TestDelay:
    @pytest.mark.parametrize("drawn", [False, True])
    def test_commands_take_effect_so_many_ticks_later(self, drawn):
        """With a delay of n ticks the joints do what the prompt ones did n ticks before."""
        delay = 2
        kind = (
            {"randomization": Randomization(delay=(delay, delay))}
            if drawn
            else {"command_delay": delay}
        )
        prompt, late = (
            gymnasium.make("ICubJump-v0", agent_frequency=200, **config).unwrapped
            for config in ({}, kind)
        )
        commands = {}
        for env in (prompt, late):
            env.reset(seed=0)
            commands[env] = []
            for _ in range(delay + 1):
                env.step(ZERO)
                commands[env].append(env.snapshot().joint_velocity_command)
        assert commands[prompt][0].any()
        for tick in range(delay):
            assert not commands[late][tick].any()
        np.testing.assert_allclose(commands[late][delay], commands[prompt][0], atol=1e-9)

    def test_delays_add_up(self):
        env = gymnasium.make(
            "ICubJump-v0", agent_frequency=200, command_delay=1,
            randomization=Randomization(delay=(1, 1)),
        ).unwrapped  # fmt: skip
        env.reset(seed=0)
        env.step(ZERO)
        env.step(ZERO)
        assert not env.snapshot().joint_velocity_command.any()
        env.step(ZERO)
        assert env.snapshot().joint_velocity_command.any()


class TestPush:
    def test_the_impulse_is_the_one_drawn(self):
        """In the air a push changes the CoM's velocity by impulse / mass."""
        impulse = 2.0
        env = gymnasium.make(
            "ICubJump-v0", randomization=Randomization(push=(impulse, impulse))
        ).unwrapped
        _, info = env.reset(seed=0)
        env.data.qpos[2] += 1.0
        simulation, begin = env._simulation, env.data.time
        com_velocity = []
        while env.data.time < begin + 0.42:
            simulation.run(1, env._series)
            com_velocity.append(simulation.truth.read().com_velocity[0])
        gained = com_velocity[-1] - com_velocity[0]
        mass = env.model.body_subtreemass[0]
        assert gained == pytest.approx(impulse / mass, rel=0.02)
        start = info["world"]["push_time"] * (0.43 - PUSH_DURATION)
        before = com_velocity[round(start / 0.001) - 5]
        after = com_velocity[round((start + PUSH_DURATION) / 0.001) + 5]
        assert before == pytest.approx(com_velocity[0], abs=1e-3)
        assert after == pytest.approx(com_velocity[-1], abs=1e-3)

    @pytest.mark.parametrize("controller", ["velocity", "torque"])
    def test_a_push_in_the_launch_speeds_the_robot_up_in_its_direction(self, controller):
        velocity = {}
        for push in (-2.0, 0.0, 2.0):
            ranges = Randomization(push=(push, push))
            env = make_env(JumpConfig.of(controller=controller, randomization=ranges))
            _, info = env.reset(seed=1)
            end = info["world"]["push_time"] * (0.43 - PUSH_DURATION) + PUSH_DURATION
            while env.data.time < end:
                env.step(ZERO)
            velocity[push] = env.snapshot().com_velocity[0]
        assert velocity[-2.0] < velocity[0.0] - 0.005
        assert velocity[2.0] > velocity[0.0] + 0.005


class TestEffects:
    def test_strength_limits_the_torques(self):
        env = make_env(
            JumpConfig.of(controller="torque", randomization=Randomization(strength=(0.8, 0.8)))
        )
        env.reset(seed=0)
        most = np.zeros(23)
        for _ in range(44):
            env.step(ZERO)
            most = np.maximum(most, np.abs(env.data.ctrl))
        assert (most <= 0.8 * ROBOT.effort_limit + 1e-9).all()
        assert most[ROBOT.joint_names.index("l_knee")] == pytest.approx(0.8 * 37.0)

    def test_encoder_bias_moves_the_crouch_the_other_way(self):
        """The servos hold what the encoders show, so the joints are off by the bias."""
        env = make_env(JumpConfig.of(randomization=Randomization(encoder_bias=(0.015, 0.015))))
        _, info = env.reset(seed=0)
        bias = np.array(info["world"]["encoder_bias"])
        shown = env._simulation.sensors.readings.joint_position
        np.testing.assert_allclose(env.data.qpos[7:] + bias, shown, atol=1e-12)
        np.testing.assert_allclose(shown, env.robot.crouch, atol=0.012)

    def test_both_sources_of_encoder_bias_show_and_servos_see_them(self):
        ranges = Randomization(encoder_bias=(0.01, 0.01))
        biased = SensorConfig(joint_position=SensorError(bias=0.004))
        env = make_env(JumpConfig.of(randomization=ranges, sensors=biased))
        _, info = env.reset(seed=0)
        own = np.array(info["sensor_errors"]["joint_position"]["bias"])
        assert 0.001 < np.abs(own).max() <= 0.004
        shown = env._simulation.sensors.readings.joint_position
        bias = np.array(info["world"]["encoder_bias"]) + own
        np.testing.assert_allclose(env.data.qpos[7:] + bias, shown, atol=1e-12)
        np.testing.assert_allclose(shown, env.robot.crouch, atol=0.012)

    def test_sensor_noise_is_that_of_the_realistic_sensors(self):
        env = make_env(JumpConfig.of(randomization=Randomization(sensor_noise=(1.0, 1.0))))
        env.reset(seed=0)
        sensors, errors = env._simulation.sensors, []
        for _ in range(200):
            sensors.read()
            errors.append(sensors.readings.joint_velocity - env.data.qvel[6:])
        expected = SENSORS["realistic"].joint_velocity.noise
        assert np.std(errors) == pytest.approx(expected, rel=0.05)
        assert env._simulation.sensors.drawn()["gyro"]["bias"] == (0.0, 0.0, 0.0)

    def test_sensor_errors_differ_between_seeds_and_not_with_other_errors(self):
        def gyro_bias(seed, **other):
            config = SensorConfig(gyro=SensorError(bias=0.1), **other)
            env = make_env(JumpConfig.of(sensors=config))
            return env.reset(seed=seed)[1]["sensor_errors"]["gyro"]["bias"]

        alone = gyro_bias(7)
        assert alone == gyro_bias(7, joint_position=SensorError(bias=0.01, noise=0.001))
        assert alone == gyro_bias(7, force_gain=0.1)
        assert alone != gyro_bias(8)

    def test_force_sensor_errors_reach_the_torque_loop(self):
        biased = SensorConfig(force=SensorError(bias=20.0))
        knee = ROBOT.joint_names.index("l_knee")
        torques = []
        for sensors in (SensorConfig(), biased):
            env = make_env(
                JumpConfig.of(controller="torque", actuators="torque_feedback", sensors=sensors)
            )
            env.reset(seed=0)
            for _ in range(5):
                env.step(ZERO)
            torques.append(env.data.ctrl[knee])
        assert abs(torques[0] - torques[1]) > 0.3

    def test_joint_gains_vary(self):
        """A weaker servo holds the crouch less exactly against the same load."""
        errors = []
        for gain in (0.5, 1.0):
            ranges = Randomization(joint_gain=(gain, gain), payload_mass=(3.0, 3.0))
            env = make_env(JumpConfig.of(randomization=ranges))
            env.reset(seed=0)
            errors.append(np.abs(env.data.qpos[7:] - env.robot.crouch).max())
        assert errors[0] > 1.3 * errors[1]

    def test_friction_acts_in_full_while_a_motor_brakes_at_its_limit(self):
        """MuJoCo clamps motor torques at the effort limit, but not what friction adds."""
        env = make_env(JumpConfig.of(actuators="realistic"))
        env.reset(seed=0)
        simulation, data = env._simulation, env.data
        data.qvel[6:] = 3.0
        simulation.command(JointCommand(-ROBOT.velocity_limit))
        simulation.run(1, env._series)
        friction = FRICTION * ROBOT.effort_limit
        np.testing.assert_allclose(data.qfrc_actuator[6:], -ROBOT.effort_limit, atol=1e-9)
        np.testing.assert_allclose(data.qfrc_applied[6:], -friction, rtol=1e-6)

    def test_slope_shows_in_the_imu(self):
        slope = 0.02
        env = make_env(JumpConfig.of(randomization=Randomization(slope=(slope, slope))))
        env.reset(seed=0)
        base_pitch = env.snapshot().base_pitch
        gravity = env._simulation.sensors.readings.gravity
        # Uphill: gravity points backward in a frame that leans with the floor.
        assert np.arctan2(gravity[0], -gravity[2]) == pytest.approx(base_pitch - slope, abs=1e-6)

    @pytest.mark.parametrize("name", sorted(ACTUATORS))
    def test_the_velocity_jump_survives_every_actuator_preset(self, name):
        assert jump(actuators=name, stand_time=0.5).is_success

    def test_a_slow_torque_loop_costs_the_torque_controller_height(self):
        """The paper: "the low level torque parameters were tuned for less dynamic tasks"."""
        slow, fast = (
            jump(
                controller="torque",
                actuators=ActuatorConfig(torque_loop=TorqueFeedback(bandwidth)),
            )
            for bandwidth in (0.3, 100.0)
        )
        assert fast.is_success
        assert slow.jump["flight_height"] < fast.jump["flight_height"] - 0.005

    def test_the_velocity_controller_does_not_use_the_torque_loop(self, nominal):
        slow = ActuatorConfig(torque_loop=TorqueFeedback(1.0))
        assert jump(actuators=slow).jump == nominal.jump
