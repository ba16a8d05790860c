"""What an action moves and what an observation has, where they are not the default."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import ActionError, ConfigError
from icub_jump_env.estimation.readings import LOADED
from icub_jump_env.observation import BLOCKS, HISTORY_BLOCKS, SIZE, Layout, ObservationConfig
from icub_jump_env.planning.residual import AXES, COM_AXES, ResidualConfig
from icub_jump_env.simulation.sensors import falsify_cop, find_cop

STEPS = 90

axes = st.sets(st.sampled_from(AXES), min_size=1).map(
    lambda chosen: tuple(axis for axis in AXES if axis in chosen)
)


def play(action=0.0, steps=STEPS, seed=3, **config):
    """Observations, true trajectory and the environment of some steps with one action."""
    env = ICubJumpEnv(randomization="hard", **config)
    seen, found = [env.reset(seed=seed)[0]], []
    for _ in range(steps):
        actions = np.full(env.action_space.shape, action, np.float32)
        seen.append(env.step(actions)[0])
        found.append(env.data.qpos.copy())
    return np.array(seen), np.array(found), env


class TestAction:
    @settings(max_examples=6)
    @given(axes)
    def test_zero_is_the_baseline_bit_for_bit(self, chosen):
        for controller in ("velocity", "torque"):
            _, baseline, _ = play(controller=controller)
            _, ours, _ = play(
                controller=controller, residual_axes=chosen, residual_phases="all",
                residual_bandwidth=40.0, observation={"cop": True, "contacts": True, "history": 3},
            )  # fmt: skip
            np.testing.assert_array_equal(ours, baseline)

    @pytest.mark.parametrize("axis", COM_AXES)
    def test_an_axis_alone_is_that_axis_of_the_default_action(self, axis):
        env = ICubJumpEnv()
        env.reset(seed=0)
        alone = ICubJumpEnv(residual_axes=(axis,))
        alone.reset(seed=0)
        for _ in range(30):
            env.step(0.7 * np.eye(3)[COM_AXES.index(axis)])
            alone.step([0.7])
        np.testing.assert_array_equal(alone.data.qpos, env.data.qpos)

    @pytest.mark.parametrize(("axis", "row"), [("roll", 0), ("pitch", 1)])
    @pytest.mark.parametrize("controller", ["velocity", "torque"])
    def test_the_momentum_follows_its_axis(self, controller, axis, row):
        """The controllers track it: by the end of the launch most of it is there."""
        momenta = {}
        for action in (0.0, 0.5):
            env = ICubJumpEnv(
                controller=controller, residual_axes=(axis,), residual_bandwidth=30.0
            )
            env.reset(seed=0)
            for _ in range(30):
                env.step([action])
            assert env._controller.launching
            momenta[action] = env.snapshot().angular_momentum
        wanted = 0.5 * ResidualConfig().scale[AXES.index(axis)]
        assert momenta[0.5][row] - momenta[0.0][row] == pytest.approx(wanted, rel=0.35)

    def test_after_the_launch_the_momentum_costs_and_shows_nothing(self):
        seen, _, env = play(1.0, residual_axes=("pitch",), residual_phases="all")
        assert not env._controller.launching
        where = env.layout.slices["residual_momentum"]
        assert seen[30, where][1] > 0.5
        assert abs(seen[-1, where]).max() < 1e-3
        *_, info = env.step([1.0])
        assert info["reward_residual"] == 0.0

    def test_the_scale_of_the_momentum_may_be_left_out(self):
        assert ResidualConfig((0.01, 0.02, 0.03)).scale[3:] == ResidualConfig().scale[3:]
        assert ResidualConfig((0.01, 0.02, 0.03, 4.0)).scale == (0.01, 0.02, 0.03, 4.0, 1.5)

    @pytest.mark.parametrize("wrong", [(), ("pitch", "forward"), ("up",), "pitch", None, (1,)])
    def test_other_axes_are_refused(self, wrong):
        with pytest.raises(ConfigError, match="axes"):
            ResidualConfig(axes=wrong)

    def test_an_action_has_an_entry_for_each_axis(self):
        env = ICubJumpEnv(residual_axes=("forward", "pitch"))
        env.reset(seed=0)
        assert env.action_space.shape == (2,)
        with pytest.raises(ActionError, match="2 finite numbers"):
            env.step(np.zeros(3))


class TestObservation:
    def test_what_is_added_stands_behind_the_default(self):
        default, _, _ = play(steps=20)
        more, _, env = play(steps=20, observation=ObservationConfig(True, True, 2))
        np.testing.assert_array_equal(more[:, :SIZE], default)
        assert more.shape[1] == env.layout.size > SIZE
        assert env.observation_space.contains(more[-1])

    def test_standing_the_centre_of_pressure_is_below_the_com(self):
        """Statics: without acceleration, forces act where the weight does."""
        env = ICubJumpEnv(observation={"cop": True})
        observation, _ = env.reset(seed=0)
        truth, readings = env._simulation.truth.read(), env._simulation.sensors.readings
        cop = observation[env.layout.slices["cop"]].reshape(2, 2) * 0.05
        places = truth.sole_position[:, :2] + cop
        common = readings.foot_force @ places / readings.foot_force.sum()
        np.testing.assert_allclose(common, truth.com[:2], atol=2e-3)

    def test_in_the_air_there_is_none(self):
        seen, _, env = play(steps=STEPS, observation={"cop": True, "contacts": True})
        slices = env.layout.slices
        contact, cop = seen[:, slices["contact"]], seen[:, slices["cop"]]
        np.testing.assert_array_equal(contact, 300.0 * seen[:, slices["foot_force"]] > LOADED)
        in_the_air = ~contact.any(axis=1)
        assert 5 < in_the_air.sum() < STEPS / 2
        assert not cop[in_the_air].any()
        assert cop[~in_the_air].any(axis=1).all()

    def test_the_history_is_what_was_seen(self):
        seen, _, env = play(0.2, steps=30, observation=ObservationConfig(cop=True, history=3))
        for name in set(HISTORY_BLOCKS) & set(env.layout.slices):
            now = seen[:, env.layout.slices[name]]
            for steps in (1, 2, 3):
                before = seen[:, env.layout.slices[f"{name}@{steps}"]]
                np.testing.assert_array_equal(before[steps:], now[:-steps])
                np.testing.assert_array_equal(before[:steps], now[[0] * steps])

    def test_steps_between_those_of_a_policy_are_not_remembered(self):
        """Stepped faster, with the same actions, the robot remembers the same."""
        slow, fast = (
            ICubJumpEnv(agent_frequency=rate, observation={"history": 2})
            for rate in (100.0, 200.0)
        )
        seen, often = slow.reset(seed=0)[0], fast.reset(seed=0)[0]
        for k in range(25):
            np.testing.assert_array_equal(often, seen)
            action = np.array([0.5, 0.0, -0.5]) * (k % 3)
            seen = slow.step(action)[0]
            fast.step(action)
            often = fast.step(action)[0]

    def test_a_reset_forgets(self):
        env = ICubJumpEnv(observation={"history": 2})
        first, _ = env.reset(seed=0)
        for _ in range(10):
            env.step(np.ones(3))
        np.testing.assert_array_equal(env.reset(seed=0)[0], first)

    def test_the_residual_of_the_momentum_is_seen_where_it_acts(self):
        assert "residual_momentum" not in Layout().slices
        env = ICubJumpEnv(residual_axes=("pitch",))
        env.reset(seed=0)
        for _ in range(20):
            observation, *_ = env.step([1.0])
        x, y = observation[env.layout.slices["residual_momentum"]]
        assert x == 0.0
        assert y == pytest.approx(env._controller.residual.offset[4], rel=1e-6)
        assert y > 0.5

    def test_each_entry_has_a_name(self):
        layout = Layout(ObservationConfig(True, True, 2), AXES)
        assert len(layout.scales) == layout.size
        assert layout.blocks[: len(BLOCKS)] == BLOCKS

    @pytest.mark.parametrize(("field", "value"), [("cop", 1), ("history", -1), ("history", 17)])
    def test_other_options_are_refused(self, field, value):
        with pytest.raises(ConfigError, match=field):
            ObservationConfig(**{field: value})


class TestCentreOfPressure:
    FORCE = np.array([1.0, 3.0, -4.0, 120.0, 0.23, 0.11, 0.0])

    def test_it_is_in_the_frame_of_the_sole(self):
        turn, cop = 0.3, np.empty(2)
        c, s = np.cos(turn), np.sin(turn)
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        middle = np.array([0.2, 0.1, -0.01])
        find_cop(self.FORCE, middle, R, cop)
        np.testing.assert_allclose(R[:2, :2] @ cop, [0.03, 0.01], atol=1e-12)

    def test_errors_enter_as_moments_over_the_force(self):
        """x = -M_y / F, y = M_x / F, of what the sensor says."""
        cop = np.array([0.03, 0.01])
        true, told, roll, pitch = 120.0, 125.0, 0.4, -0.7
        moments = true * np.array([cop[1], -cop[0]]) + np.array([roll, pitch])
        falsify_cop(true, told, roll, pitch, cop)
        np.testing.assert_allclose(cop, [-moments[1] / told, moments[0] / told], rtol=1e-12)
        falsify_cop(true, LOADED, roll, pitch, cop)
        assert not cop.any()
