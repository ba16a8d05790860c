"""The environment when something goes wrong: diverged physics and bad input."""

import math
import pickle
from functools import partial

import gymnasium
import numpy as np
import pytest
from conftest import ZERO, rollout

from icub_jump_env.env import ICubJumpEnv
from icub_jump_env.errors import (
    ActionError,
    ConfigError,
    ICubJumpError,
    UnknownFieldError,
    shown,
)


class TestDivergence:
    @pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf, 1e6, 1e11, 1e300])
    @pytest.mark.parametrize("field", ["qpos", "qvel"])
    @pytest.mark.fault("absurd numbers")
    def test_ends_the_episode_with_finite_observations(self, env, field, poison):
        env.reset(seed=0)
        for _ in range(5):
            env.step(ZERO)
        getattr(env.unwrapped.data, field)[12] = poison
        obs, reward, terminated, truncated, info = env.step(ZERO)
        assert terminated
        assert not truncated
        assert info["diverged"]
        assert info["outcome"] == "diverged"
        assert np.isfinite(obs).all()
        assert math.isfinite(reward)
        assert not info["is_success"]

    @pytest.mark.fault("absurd numbers")
    def test_time_running_back_is_divergence(self, env):
        """A reset behind our back leaves only finite numbers and no warning."""
        import mujoco

        env.reset(seed=0)
        for _ in range(5):
            env.step(ZERO)
        mujoco.mj_resetData(env.unwrapped.model, env.unwrapped.data)
        *_, terminated, _, info = env.step(ZERO)
        assert terminated
        assert info["diverged"]

    @pytest.mark.parametrize("copied", [False, True])
    def test_leaves_no_file_and_prints_nothing(self, capfd, tmp_path, copied):
        import mujoco

        env = gymnasium.make("ICubJump-v0").unwrapped
        env.reset(seed=0)
        if copied:  # as a worker process gets it, which has yet to build a world
            log = mujoco.MjLogConfig.get()
            log.logto_console = log.logto_file = True
            log.set()
            env = pickle.loads(pickle.dumps(env))
        env.data.qvel[12] = np.nan
        assert env.step(ZERO)[4]["diverged"]
        env.data.qvel[12] = np.nan
        mujoco.mj_step(env.model, env.data)
        assert env.data.warning.number.any()
        assert capfd.readouterr() == ("", "")
        assert list(tmp_path.iterdir()) == []

    def test_step_before_reset_is_refused(self):
        env = gymnasium.make("ICubJump-v0").unwrapped
        with pytest.raises(gymnasium.error.ResetNeeded):
            env.step(ZERO)

    def test_the_next_episode_is_clean(self, env):
        clean = rollout(env)
        env.reset(seed=0)
        env.unwrapped.data.qvel[4] = np.nan
        env.step(ZERO)
        again = rollout(env)
        np.testing.assert_array_equal(again[0], clean[0])


class TestBadInput:
    @pytest.mark.parametrize(
        ("field", "value"),
        [
            ("controller", "psychic"), ("jump_height", -0.01), ("jump_height", 0.0),
            ("jump_height", 1.0), ("jump_height", math.nan), ("jump_height", "high"),
            ("jump_height", None), ("jump_height", True), ("com_displacement", 0.5),
            ("com_displacement", -0.1), ("com_displacement", math.inf), ("com_scaling", "time"),
            ("momentum_control", "yes"), ("momentum_control", 1), ("solver", "magic"),
            ("solver", ["daqp"]), ("timestep", 0.0), ("timestep", 0.1), ("timestep", math.nan),
            ("agent_frequency", 300.0), ("stand_time", -1.0), ("stand_time", math.inf),
            ("ankle_shift", 15), ("render_mode", "ansi"), ("jump_height", 10**400),
            ("robot", "iCubGenova03"), ("robot", "left_hand_mk3"), ("robot", "Nope"), ("robot", 4),
            ("robot", None), ("constraints", "firm"), ("launch_end", "never"), ("width", 8),
            ("width", 640.0), ("height", 5000), ("camera", "back"), ("reward", 1.0),
            ("success", None), ("residual", (0.1, 0.1, 0.1)), ("rendering", "human"),
        ],
    )  # fmt: skip
    @pytest.mark.filterwarnings("ignore:.*not in the possible render_modes")
    def test_make_refuses_and_names_field_value_and_range(self, field, value):
        with pytest.raises(ConfigError) as refusal:
            gymnasium.make("ICubJump-v0", **{field: value})
        assert refusal.value.field.startswith(field)
        assert shown(value) in str(refusal.value)
        assert refusal.value.allowed
        assert isinstance(refusal.value, ICubJumpError)
        assert isinstance(refusal.value, ValueError)

    @pytest.mark.parametrize(
        ("given", "named", "words"),
        [
            *(({"residual_scale": scale}, "residual_scale", shown(scale)) for scale in (
                0.1, (0.1, 0.1), (0.1, 0.1, -0.1), (0.1, 0.1, math.nan), "abc", {0.01, 0.02, 0.03},
            )),
            ({"control_frequency": 0.0}, "control_frequency", "0.0"),
            ({"control_frequency": 150.0}, "control_frequency", "1000 Hz"),
            ({"control_frequency": 3000.0}, "control_frequency", "1000 Hz"),
            ({"residual_phases": "flight"}, "residual_phases", "'flight'"),
            ({"residual": {"bandwidth": 0.0}}, "bandwidth", "0.0"),
            ({"residual": {"gain": 1.0}}, "gain", "no such field; the fields of residual are"),
            ({"reward": {"height": -1.0}}, "height", "-1.0"),
            ({"reward": {"hight": 1.0}}, "hight", "rotation"),
            ({"success": {"flight_time": 2.0}}, "flight_time", "2.0"),
            ({"rendering": {"width": 1e9}}, "width", "16 to 1920"),
        ],
    )  # fmt: skip
    def test_values_inside_groups_are_refused_by_the_name_they_were_given(
        self, given, named, words
    ):
        with pytest.raises(ConfigError) as refusal:
            ICubJumpEnv(**given)
        assert refusal.value.field == named
        assert words in str(refusal.value)

    @pytest.mark.parametrize("make", [ICubJumpEnv, partial(gymnasium.make, "ICubJump-v0")])
    def test_an_unknown_keyword_is_a_type_error_that_names_it_and_the_fields(self, make):
        """Gymnasium raises it again from its message."""
        with pytest.raises(TypeError, match=r"^wings=2 is not allowed: no such field") as refusal:
            make(wings=2)
        assert isinstance(refusal.value, ConfigError)
        assert isinstance(refusal.value, UnknownFieldError)
        for name in ("jump_height", "stand_time", "reward", "render_mode"):
            assert name in str(refusal.value)
        assert "unexpected keyword argument 'wings'" in str(refusal.value)

    def test_numpy_values_are_welcome(self):
        env = gymnasium.make(
            "ICubJump-v0",
            jump_height=np.float32(0.05),
            residual_scale=np.full(3, 0.02),
            momentum_control=np.True_,
            solver=np.str_("daqp"),
        )
        env.reset(seed=np.int64(3))
        assert env.unwrapped.config.jump_height == pytest.approx(0.05)
        env.close()

    @pytest.mark.parametrize(
        "options",
        [
            {"jump_height": -1.0},
            {"jump_height": math.nan},
            {"height": 0.04},
            {"timestep": 0.001},
            3,
        ],
    )
    def test_reset_refuses_and_stays_usable(self, env, options):
        with pytest.raises(ConfigError):
            env.unwrapped.reset(options=options)
        env.reset(seed=0)
        env.step(ZERO)

    @pytest.mark.parametrize("seed", [-1, "a", 1.5, True])
    def test_reset_refuses_bad_seeds(self, env, seed):
        with pytest.raises(ConfigError, match="seed"):
            env.unwrapped.reset(seed=seed)

    def test_errors_can_be_raised_again_from_their_message(self):
        """As Gymnasium's asynchronous vector environment does it."""
        error = ActionError(str(ActionError("action", None, "three numbers")))
        assert str(error) == "action=None is not allowed: expected three numbers"
        assert str(pickle.loads(pickle.dumps(error))) == str(error)

    @pytest.mark.parametrize(
        "action",
        [
            np.full(3, np.nan), np.full(3, np.inf), [0, 0, -np.inf], [0.5, 2, np.nan], np.zeros(2),
            np.zeros((3, 1)), ["0", "0", "0"], np.zeros(3, complex), np.zeros(3, bool), 0.0,
            [0, 0, 10**400], None, "jump", [1, 2], ["a", "b", "c"], [[0, 0], [0]],
        ],
    )  # fmt: skip
    def test_step_refuses_and_changes_nothing(self, env, action):
        env.reset(seed=0)
        env.step(ZERO)
        before = env.unwrapped.data.qpos.copy()
        with pytest.raises(ActionError) as refusal:
            env.step(action)
        assert refusal.value.field == "action"
        np.testing.assert_array_equal(env.unwrapped.data.qpos, before)

    @pytest.mark.parametrize("beyond", [[1.01, -3, 0.5], np.array([2, -2, 0.5]), [1e300, -7, 0.5]])
    def test_actions_beyond_one_are_clipped(self, env, beyond):
        steps = []
        for action in (beyond, [1, -1, 0.5]):
            env.reset(seed=0)
            steps.append(env.unwrapped.step(action))
        (observation, *beyond_result), (expected, *clipped_result) = steps
        np.testing.assert_array_equal(observation, expected)
        assert beyond_result == clipped_result

    def test_errors_survive_pickling(self):
        for kind in (ActionError, ConfigError):
            error = pickle.loads(pickle.dumps(kind("field", 3, "less")))
            assert (error.field, error.value, error.allowed) == ("field", 3, "less")
            assert str(error) == "field=3 is not allowed: expected less"
