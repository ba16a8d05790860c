"""The environment with real actuators and sensors, delays and randomised worlds."""

import dataclasses
import json
import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from conftest import ZERO, jump, random_action, rollout
from gymnasium.utils.env_checker import check_env

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.rollout import make_env
from icub_jump_env.robot import facts
from icub_jump_env.simulation.actuators.config import ACTUATORS, ActuatorConfig
from icub_jump_env.simulation.actuators.motors import DCMotor
from icub_jump_env.simulation.actuators.torque_loops import CurrentControl, TorqueFeedback
from icub_jump_env.simulation.randomization import RANDOMIZATIONS, Randomization
from icub_jump_env.simulation.sensor_models import SENSORS, SensorConfig, SensorError
from icub_jump_env.simulation.simulation import PUSH_DURATION

HARD = {
    "randomization": "hard",
    "sensors": "realistic",
    "actuators": "realistic",
    "command_delay": 1,
    "stand_time": 0.1,
}

EPISODE = (
    "import gymnasium, icub_jump_env, numpy as np, sys\n"
    "env = gymnasium.make('ICubJump-v0', randomization='hard', sensors='realistic',\n"
    "    actuators='realistic', command_delay=1, stand_time=0.1, controller=sys.argv[1])\n"
    "obs, _ = env.reset(seed=11); rng = np.random.default_rng(0); done = False; all = [obs]\n"
    "while not done:\n"
    "    obs, _, done, *_ = env.step(rng.uniform(-1, 1, 3).astype(np.float32)); all.append(obs)\n"
    "sys.stdout.buffer.write(np.array(all).tobytes())\n"
)


class TestDeterminism:
    @pytest.mark.parametrize("controller", ["velocity", "torque"])
    def test_same_seed_same_trajectory_in_another_process_and_after_other_episodes(
        self, controller
    ):
        env = gymnasium.make("ICubJump-v0", controller=controller, **HARD)
        rollout(env, random_action, seed=5)
        env.reset(seed=11)
        rng, done = np.random.default_rng(0), False
        observations = [env.reset(seed=11)[0]]
        while not done:
            obs, _, done, *_ = env.step(rng.uniform(-1, 1, 3).astype(np.float32))
            observations.append(obs)
        other = subprocess.run(
            [sys.executable, "-c", EPISODE, controller], capture_output=True, check=True
        )
        assert other.stdout == np.array(observations).tobytes()

    def test_another_seed_is_another_world(self):
        env = gymnasium.make("ICubJump-v0", **HARD)
        first, second = rollout(env, seed=1)[0], rollout(env, seed=2)[0]
        assert not np.array_equal(first[:5], second[:5])

    def test_resets_without_seed_go_on_to_new_worlds(self):
        env = gymnasium.make("ICubJump-v0", **HARD)
        worlds = [env.reset(seed=3)[1]["world"], env.reset()[1]["world"], env.reset()[1]["world"]]
        assert worlds[0] != worlds[1] != worlds[2]
        assert env.reset(seed=3)[1]["world"] == worlds[0]

    def test_same_seed_same_world_for_every_controller_and_policy(self):
        worlds = []
        for config in (
            {"controller": "velocity"},
            {"controller": "torque", "solver": "osqp"},
            {"jump_height": 0.06, "actuators": "realistic", "sensors": "realistic"},
        ):
            env = gymnasium.make("ICubJump-v0", randomization="hard", **config)
            env.reset(seed=4)
            env.step(np.ones(3, np.float32))
            worlds.append(env.reset(seed=8)[1]["world"])
        assert worlds[0] == worlds[1] == worlds[2]

    def test_a_pickled_environment_continues_bit_for_bit(self):
        env = gymnasium.make("ICubJump-v0", **HARD).unwrapped
        env.reset(seed=2)
        for _ in range(10):
            env.step(ZERO)
        twin = pickle.loads(pickle.dumps(env))
        for _ in range(30):
            np.testing.assert_array_equal(env.step(ZERO)[0], twin.step(ZERO)[0])
        assert env.reset()[1]["world"] == twin.reset()[1]["world"]

    def test_none_is_the_nominal_jump_whatever_came_before(self, nominal):
        """Naming the ideal models by their fields changes no bit."""
        explicit = jump(
            actuators=ActuatorConfig(),
            sensors=SensorConfig(),
            randomization=Randomization(),
            command_delay=0,
        )
        assert explicit.jump == nominal.jump


def test_checker_passes_with_everything_on():
    check_env(gymnasium.make("ICubJump-v0", **HARD).unwrapped, skip_render_check=True)


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
            simulation.step()
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
            env = make_env(JumpConfig(controller=controller, randomization=ranges))
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
            JumpConfig(controller="torque", randomization=Randomization(strength=(0.8, 0.8)))
        )
        env.reset(seed=0)
        most = np.zeros(23)
        for _ in range(44):
            env.step(ZERO)
            most = np.maximum(most, np.abs(env.data.ctrl))
        assert (most <= 0.8 * facts.EFFORT_LIMIT + 1e-9).all()
        assert most[facts.JOINT_INDEX["l_knee"]] == pytest.approx(0.8 * 37.0)

    def test_encoder_bias_moves_the_crouch_the_other_way(self):
        """The servos hold what the encoders show, so the joints are off by the bias."""
        env = make_env(JumpConfig(randomization=Randomization(encoder_bias=(0.015, 0.015))))
        _, info = env.reset(seed=0)
        bias = np.array(info["world"]["encoder_bias"])
        shown = env._simulation.sensors.joint_position
        np.testing.assert_allclose(env.data.qpos[7:] + bias, shown, atol=1e-12)
        np.testing.assert_allclose(shown, env._crouch, atol=0.012)

    def test_slope_shows_in_the_imu(self):
        slope = 0.02
        env = make_env(JumpConfig(randomization=Randomization(slope=(slope, slope))))
        env.reset(seed=0)
        base_pitch = env.snapshot().base_pitch
        gravity = env._simulation.sensors.gravity
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


class TestConfiguration:
    def test_models_come_back_from_json(self):
        config = JumpConfig(
            actuators=ActuatorConfig(torque_loop=CurrentControl(100.0), motor=DCMotor(0.9)),
            sensors=SensorConfig(gyro=SensorError(noise=0.1), delay=1),
            randomization=Randomization(friction=(0.4, 1)),
        )
        saved = json.loads(json.dumps(dataclasses.asdict(config)))
        assert JumpConfig.from_kwargs(saved) == config

    def test_names_stand_for_models(self):
        config = JumpConfig(actuators="realistic", sensors="realistic", randomization="mild")
        assert config.actuator_config == ACTUATORS["realistic"]
        assert config.sensor_config == SENSORS["realistic"]
        assert config.randomization_config == RANDOMIZATIONS["mild"]

    @pytest.mark.parametrize(
        ("field", "value"),
        [
            ("actuators", "magic"), ("actuators", 3), ("actuators", {"wings": 1}),
            ("actuators", {"torque_loop": {"kind": "magic"}}), ("actuators", DCMotor()),
            ("sensors", None), ("sensors", {"gyro": {"nose": 1.0}}), ("sensors", {"gyro": 0.1}),
            ("randomization", "extreme"), ("randomization", {"friction": [0.4]}),
            ("randomization", {"friction": "low"}), ("command_delay", -1),
            ("command_delay", 1.5), ("command_delay", True),
        ],
    )  # fmt: skip
    def test_bad_models_are_refused(self, field, value):
        with pytest.raises(ConfigError) as refusal:
            JumpConfig(**{field: value})
        assert refusal.value.field == field

    def test_a_bad_value_inside_a_model_names_its_field(self):
        with pytest.raises(ConfigError, match=r"friction=.*lower bound first"):
            JumpConfig(randomization={"friction": [1.0, 0.4]})
