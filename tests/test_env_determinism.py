"""The same seed gives the same bits: in any process, after any episode, in every copy."""

import copy
import pickle
import subprocess
import sys

import gymnasium
import mujoco
import numpy as np
import pytest
from conftest import HARD, ZERO, random_action, rollout

EPISODE = (
    "import gymnasium, icub_jump_env, numpy as np, sys\n"
    "env = gymnasium.make('ICubJump-v0', randomization='hard', sensors='realistic',\n"
    "    actuators='realistic', command_delay=1, stand_time=0.1, controller=sys.argv[1])\n"
    "obs, _ = env.reset(seed=11); rng = np.random.default_rng(0); done = False; all = [obs]\n"
    "while not done:\n"
    "    obs, _, done, *_ = env.step(rng.uniform(-1, 1, 3).astype(np.float32)); all.append(obs)\n"
    "sys.stdout.buffer.write(np.array(all).tobytes())\n"
)


class TestNominalWorld:
    def test_same_seed_same_bits_also_after_dirty_episodes(self, env):
        fresh = rollout(env, random_action, seed=3)
        rollout(env, random_action, seed=4)
        env.reset(seed=5)
        for _ in range(47):
            env.step(np.ones(3, np.float32))
        again = rollout(env, random_action, seed=3)
        np.testing.assert_array_equal(again[0], fresh[0])
        np.testing.assert_array_equal(again[1], fresh[1])
        assert again[2] == fresh[2]

    @pytest.mark.parametrize("solver", ["daqp", "osqp"])
    def test_same_bits_in_another_process(self, solver):
        program = (
            "import gymnasium, icub_jump_env, numpy as np, hashlib\n"
            f"env = gymnasium.make('ICubJump-v0', stand_time=0.1, solver={solver!r})\n"
            "env.reset(seed=0); h = hashlib.sha256(); done = False\n"
            "while not done:\n"
            "    obs, r, done, _, info = env.step(np.full(3, 0.1, np.float32))\n"
            "    h.update(obs.tobytes()); h.update(env.unwrapped.data.qpos.tobytes())\n"
            "print(h.hexdigest())\n"
        )
        digests = {
            subprocess.run(
                [sys.executable, "-c", program], check=True, capture_output=True, text=True
            ).stdout
            for _ in range(2)
        }
        assert len(digests) == 1

    def test_interleaved_environments_do_not_disturb_each_other(self):
        alone = rollout(gymnasium.make("ICubJump-v0", stand_time=0.1), random_action, 1)
        envs = [gymnasium.make("ICubJump-v0", stand_time=0.1, jump_height=h) for h in (0.04, 0.06)]
        rngs = [np.random.default_rng(1), np.random.default_rng(2)]
        observations = [envs[0].reset(seed=1)[0]]
        envs[1].reset(seed=2)
        done = [False, False]
        while not done[0]:
            for i in range(2):
                if not done[i]:
                    obs, _, done[i], _, _ = envs[i].step(random_action(rngs[i]))
                    if i == 0:
                        observations.append(obs)
        np.testing.assert_array_equal(np.array(observations), alone[0])

    def test_stepping_at_the_control_rate_changes_nothing(self):
        """An agent at 200 Hz with zero actions sees the trajectory of one at 100 Hz."""
        states = []
        for frequency in (100.0, 200.0):
            env = gymnasium.make("ICubJump-v0", agent_frequency=frequency).unwrapped
            env.reset(seed=0)
            for _ in range(round(0.6 * frequency)):
                env.step(ZERO)
            states.append(np.concatenate((env.data.qpos, env.data.qvel)))
            env.close()
        np.testing.assert_array_equal(*states)

    def test_zero_residual_is_the_baseline(self, env):
        """Whatever the residual scale: the zero action leaves the reference untouched."""
        wide = gymnasium.make("ICubJump-v0", stand_time=0.3, residual_scale=(0.1, 0.1, 0.1))
        none = gymnasium.make("ICubJump-v0", stand_time=0.3, residual_scale=(0.0, 0.0, 0.0))
        states = []
        for candidate, action in ((wide, ZERO), (none, np.ones(3, np.float32)), (env, -ZERO)):
            candidate.reset(seed=0)
            for _ in range(70):
                candidate.step(action)
            states.append(candidate.unwrapped.data.qpos.copy())
        np.testing.assert_array_equal(states[0], states[1])
        np.testing.assert_array_equal(states[0], states[2])


FEEDBACK = {"estimator": "imu", "flight": "feedback", "landing": "feedback"}


def pickled(env):
    return pickle.loads(pickle.dumps(env))


@pytest.mark.parametrize(
    ("config", "steps", "copier"),
    [
        *(({}, steps, copier) for steps in (0, 20, 50, 70) for copier in (copy.deepcopy, pickled)),
        *(
            (config, *moment)
            for config in (
                {"constraints": "hard", "residual_phases": "all"},
                {"controller": "torque"},
                {"controller": "torque", "constraints": "hard", "launch_end": "lift_off"},
                {"robot": "iCubGenova02", "solver": "osqp"},
            )
            for moment in ((20, pickled), (40, copy.deepcopy), (50, pickled))
        ),
        # In the first crouch, and in the second launch.
        *(
            ({"jumps": 2, **config}, *moment)
            for config in ({}, {"controller": "torque", **FEEDBACK})
            for moment in ((150, pickled), (185, copy.deepcopy), (220, pickled))
        ),
    ],
    ids=lambda value: getattr(value, "__name__", str(value)),
)
def test_a_copy_continues_bit_for_bit(config, steps, copier):
    env = gymnasium.make("ICubJump-v0", stand_time=0.1, **config)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        env.step(random_action(rng))
    twin = copier(env)
    assert twin.unwrapped.data is not env.unwrapped.data
    terminated = False
    while not terminated:
        action = random_action(rng)
        results = [e.step(action) for e in (env, twin)]
        np.testing.assert_array_equal(results[0][0], results[1][0])
        assert results[0][1] == results[1][1]
        terminated = results[0][2]
    assert str(results[0][4]) == str(results[1][4])
    np.testing.assert_array_equal(env.unwrapped.data.qpos, twin.unwrapped.data.qpos)


EVENTS = {
    "takeoff_spin": (0.2, 0.2), "flight_push": (0.5, 0.5), "landing_push": (0.5, 0.5),
    "floor_tilt": (0.02, 0.02),
}  # fmt: skip


class TestLoops:
    """The physics steps of a control tick, compiled or one by one from Python."""

    @pytest.mark.parametrize(
        "config",
        [
            {"stand_time": 0.1},
            {"controller": "torque", **HARD},
            {"jumps": 2, "stand_time": 0.1, "randomization": "full", **FEEDBACK},
            {"randomization": EVENTS, "actuators": "realistic", "stand_time": 0.1, **FEEDBACK},
            {"momentum_control": False},  # which falls in the middle of a tick
        ],
        ids=str,
    )
    def test_both_give_the_same_bits(self, config):
        found = []
        for loop in ("compiled", "python"):
            env = gymnasium.make("ICubJump-v0", physics_loop=loop, **config)
            *courses, info = rollout(env, random_action, seed=2)
            data, physics = env.unwrapped.data, env.unwrapped._simulation.physics
            found.append((*courses, data.qpos, data.qvel, data.time, physics.evaluated_time, info))
        for ours, theirs in zip(*(bits[:-1] for bits in found), strict=True):
            np.testing.assert_array_equal(ours, theirs)
        assert str(found[0][-1]) == str(found[1][-1])

    def test_both_notice_a_simulation_that_diverges(self):
        infos = []
        for loop in ("compiled", "python"):
            env = gymnasium.make("ICubJump-v0", physics_loop=loop)
            env.reset(seed=0)
            env.unwrapped.data.qvel[12] = np.nan
            *_, terminated, _, info = env.step(ZERO)
            assert terminated
            infos.append(info)
        assert infos[0]["outcome"] == infos[1]["outcome"] == "diverged"
        assert infos[0]["time"] == infos[1]["time"]

    @pytest.mark.parametrize(("loop", "seen"), [("compiled", 0), ("python", 10)])
    def test_python_can_watch_its_own_steps_alone(self, loop, seen, monkeypatch):
        env, steps, step = gymnasium.make("ICubJump-v0", physics_loop=loop), [], mujoco.mj_step
        env.reset(seed=0)
        monkeypatch.setattr(mujoco, "mj_step", lambda *given: steps.append(step(*given)))
        env.step(ZERO)
        assert len(steps) == seen


class TestSettling:
    """A reset lets the robot settle but once, unless something is not as it was."""

    def make(self, **config):
        return gymnasium.make("ICubJump-v0", **config).unwrapped

    def stand(self, env):
        env.reset(seed=0)
        return env.data.qpos.copy(), env.data.qacc.copy()

    def test_a_changed_model_settles_anew(self):
        changed, fresh = self.make(), self.make()
        before = self.stand(changed)
        for env in (changed, fresh):
            env.model.body_mass[-1] *= 1.5
        after = self.stand(changed)
        assert not np.array_equal(before[0], after[0])
        for own, other in zip(after, self.stand(fresh), strict=True):
            np.testing.assert_array_equal(own, other)

    def test_both_loops_stand_alike_after_a_jump(self):
        compiled, python = self.make(), self.make(physics_loop="python")
        for env in (compiled, python):
            env.reset(seed=0)
            for _ in range(60):
                env.step(ZERO)
        for own, other in zip(self.stand(compiled), self.stand(python), strict=True):
            np.testing.assert_array_equal(own, other)


class TestVariedWorlds:
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

    @pytest.mark.parametrize("actuators", ["ideal", "realistic"])
    def test_a_reset_in_the_middle_of_a_launch_leaves_nothing_behind(self, actuators):
        config = {
            "controller": "torque", "actuators": actuators, "sensors": "realistic",
            "command_delay": 2, "stand_time": 0.1,
        }  # fmt: skip
        fresh = rollout(gymnasium.make("ICubJump-v0", **config), seed=3)[0]
        env = gymnasium.make("ICubJump-v0", **config)
        env.reset(seed=1)
        for _ in range(30):
            env.step(np.ones(3, np.float32))
        np.testing.assert_array_equal(rollout(env, seed=3)[0], fresh)
