"""``eval.py --policy``: who jumps, in which environment, and what is refused."""

import contextlib
import io
import json
import shlex
from functools import partial

import numpy as np
import pytest
from contenders import FEEDBACK, evaluate, refusal, save, save_constant
from rich.console import Console

from experiments.rivals import constant_shift
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.contender import BASELINE, Contender, read_contenders
from icub_jump_env.evaluation.episodes.log import EpisodeLog
from icub_jump_env.evaluation.episodes.rollout import make_env, run_episode, traced
from icub_jump_env.evaluation.figures import policy as policy_figures
from icub_jump_env.evaluation.modes import video, view
from icub_jump_env.policy import ReplayPolicy, load_policy

QUIET = Console(file=io.StringIO())
SHORT = ("--stand-time", "0.1")


def jump_of(policy, **config):
    """Metrics as JSON has them: of the policy, or of the baseline."""
    env = make_env(JumpConfig.of(stand_time=0.1, **config))
    episode = run_episode(env, 0, *([policy] if policy else []))
    env.close()
    return json.loads(json.dumps(episode.jump))


class TestSingleJump:
    def test_a_policy_that_does_nothing_jumps_like_the_baseline(self, capsys, tmp_path):
        file = save_constant(tmp_path / "zero.safetensors", 0, 0, 0)
        code, out, _ = evaluate(capsys, "--policy", file, *SHORT, "--json", "r.json")
        assert code == 0
        assert "paper ours 10 to 90 % difference baseline" in " ".join(out.split())
        arms = json.loads((tmp_path / "r.json").read_text())["arms"]
        assert arms["policy"]["jump"] == arms["baseline"]["jump"] == jump_of(None)

    def test_the_table_sets_the_policy_beside_the_baseline(self, capsys, tmp_path):
        file = save(tmp_path / "mine.safetensors", FEEDBACK)
        code, out, _ = evaluate(capsys, "--policy", file, *SHORT, "--json", "r.json")
        assert code == 0
        content = json.loads((tmp_path / "r.json").read_text())
        arms = content["arms"]
        assert list(arms) == ["policy", "baseline"]
        assert arms["policy"]["jump"] == jump_of(FEEDBACK)
        assert arms["baseline"]["jump"] == jump_of(None)
        assert arms["policy"]["policy"] == read_contenders([str(file)])[0].identity
        assert arms["baseline"]["policy"] == {"name": "baseline", "sha256": None}
        lean = next(r for r in content["comparison"] if r["quantity"] == "rotation in flight")
        ours, theirs = (
            np.degrees(arms[name]["repeated"]["percentiles"]["flight_rotation"][1])
            for name in ("policy", "baseline")
        )
        assert (lean["ours"], lean["other"]) == pytest.approx((ours, theirs))
        row = next(line.split() for line in out.splitlines() if "rotation in flight" in line)
        assert (row[5], row[-1]) == (f"{ours:.1f}", f"{theirs:.1f}")
        assert row[5] != row[-1]

    def test_the_picture_shows_where_the_reference_was_moved(self, capsys, tmp_path, monkeypatch):
        drawn, figure = [], policy_figures.policy_figure
        monkeypatch.setattr(
            policy_figures, "policy_figure", lambda *arms: drawn.append(arms) or figure(*arms)
        )
        file = save_constant(tmp_path / "mine.safetensors", 0.5, -0.5, 0.2)
        code, _, err = evaluate(capsys, "--policy", file, *SHORT, "--plot", "figures")
        assert (code, err) == (0, "wrote figures/policy.png\n")
        offset, height, pitch = figure(*drawn[0]).axes
        # Nearly all of the residual scale (0.06, 0.02, 0.02 m) times the action, in cm.
        asked = {"forward": 3.0, "left": -1.0, "up": 0.4}
        for line, (name, target) in zip(offset.lines[:3], asked.items(), strict=True):
            assert line.get_label() == name
            assert line.get_ydata()[0] == 0.0
            assert 0.5 < line.get_ydata()[-1] / target <= 1.0
        for axis in (height, pitch):
            ours, theirs = (np.array(line.get_ydata())[:40] for line in axis.lines[:2])
            assert np.ptp(ours - theirs) > 0

    def test_the_baseline_is_jumped_without_the_constraint_if_the_policy_is(
        self, capsys, tmp_path
    ):
        file = save_constant(tmp_path / "p.safetensors", 0.1, 0, 0, momentum_control=False)
        code, *_ = evaluate(capsys, "--policy", file, *SHORT, "--json", "r.json")
        assert code == 0
        arms = json.loads((tmp_path / "r.json").read_text())["arms"]
        assert arms["baseline"]["jump"] == jump_of(None, momentum_control=False)

    def test_the_card_or_the_arrays_name_the_policy(self, capsys, tmp_path):
        file = save(tmp_path / "mine.safetensors", FEEDBACK)
        tables = {
            evaluate(capsys, "--policy", name, *SHORT)[1]
            for name in (file, file.with_suffix(".json"))
        }
        assert len(tables) == 1

    def test_the_word_baseline_is_a_contender_like_no_policy(self, capsys):
        assert evaluate(capsys, "--policy", "baseline", *SHORT) == evaluate(capsys, *SHORT)


class TestInNoFile:
    def test_its_code_and_what_it_holds_tell_it_from_others(self):
        assert Contender("a", own).identity == Contender("a", own).identity
        assert Contender("a", own).identity["sha256"] is not None
        assert Contender("a", own).identity != Contender("a", FEEDBACK).identity
        assert Contender("a", FEEDBACK).identity != BASELINE.identity
        assert not Contender("a", own).is_baseline

    def test_what_is_bound_to_it_is_told_by_the_version(self):
        first = Contender("a", partial(own), version="1").identity
        assert first == Contender("a", own, version="1").identity
        assert first != Contender("a", partial(own), version="2").identity

    def test_its_numbers_tell_a_network_or_replay_from_others(self):
        numbers = np.zeros((1, 2, 3), np.float32)
        made = [
            ReplayPolicy(np.float32([0.04]), actions, 20.0) for actions in (numbers, numbers + 0.1)
        ]
        made += [ReplayPolicy(np.float32([0.04]), numbers, 25.0)]
        made += [constant_shift(forward, 0.0) for forward in (0.0, 0.1)]
        assert len({Contender("a", policy).identity["sha256"] for policy in made}) == len(made)
        again = ReplayPolicy(np.float32([0.04]), numbers.copy(), 20.0)
        assert Contender("a", again).identity == Contender("a", made[0]).identity

    def test_a_policy_from_a_file_brings_its_card(self, tmp_path):
        file = save(tmp_path / "a.safetensors", FEEDBACK)
        (read,) = read_contenders([str(file)])
        assert Contender("a", load_policy(file)).identity == read.identity

    def test_what_cannot_be_told_from_others_is_refused(self):
        made = eval("lambda observation: observation[:3]")
        with pytest.raises(ConfigError, match="a file"):
            _ = Contender("a", made).identity


def own(observation):
    return np.zeros(3, np.float32)


CARD = {
    "com_displacement": 0.1, "residual_scale": (0.03, 0.01, 0.01), "agent_frequency": 50.0,
    "jump_height": (0.03, 0.05), "sensors": "realistic", "randomization": "full",
}  # fmt: skip


class TestAsTrained:
    @pytest.fixture
    def file(self, tmp_path):
        return save(tmp_path / "trained.safetensors", FEEDBACK, **CARD)

    def config(self, capsys, tmp_path, *arguments):
        code, _, err = evaluate(capsys, *arguments, *SHORT, "--json", "r.json")
        assert code == 0, err
        content = json.loads((tmp_path / "r.json").read_text())
        return JumpConfig.of(**content["config"])

    def test_the_filter_of_the_residual_is_the_policys(self, capsys, tmp_path):
        file = save(tmp_path / "quick.safetensors", FEEDBACK, residual_bandwidth=20.0)
        assert self.config(capsys, tmp_path, "--policy", file).residual.bandwidth == 20.0

    def test_what_the_policy_depends_on_is_as_the_card_says_and_nothing_else(
        self, capsys, tmp_path, file
    ):
        assert self.config(capsys, tmp_path, "--policy", file) == JumpConfig.of(
            stand_time=0.1, com_displacement=0.1, residual_scale=(0.03, 0.01, 0.01),
            agent_frequency=50.0,
        )  # fmt: skip
        jump = json.loads((tmp_path / "r.json").read_text())["arms"]["policy"]["jump"]
        task = {name: CARD[name] for name in list(CARD)[:3]}
        assert jump == jump_of(FEEDBACK, **task)
        assert jump != jump_of(FEEDBACK)

    def test_flags_may_say_what_the_card_says_and_all_the_rest(self, capsys, tmp_path, file):
        flags = [
            "--com-displacement", "0.1", "--control-frequency", "200", "--jump-height", "0.05",
            "--sensors", "realistic", "--solver", "osqp",
        ]  # fmt: skip
        found = self.config(capsys, tmp_path, "--policy", file, *flags)
        assert found == JumpConfig.of(
            stand_time=0.1, com_displacement=0.1, residual_scale=(0.03, 0.01, 0.01),
            agent_frequency=50.0, control_frequency=200.0, jump_height=0.05,
            sensors="realistic", solver="osqp",
        )  # fmt: skip

    @pytest.mark.parametrize(
        ("flags", "words"),
        [
            (["--com-displacement", "0.12"], ["com_displacement=0.12 instead of 0.1"]),
            (["--no-ankle-shift"], ["ankle_shift=False instead of True"]),
            (["--agent-frequency", "100"], ["agent_frequency=100.0 instead of 50.0"]),
            (
                ["--momentum-control", "False", "--controller", "torque"],
                ["momentum_control=False instead of True", "controller='torque' instead of",
                 "control_frequency=500.0 instead of 200.0"],
            ),
        ],
    )  # fmt: skip
    def test_flags_that_contradict_it_are_refused(self, capsys, file, flags, words):
        message = refusal(capsys, "--policy", file, *flags)
        for word in words:
            assert word in message

    def test_an_observation_that_has_changed_is_refused(self, capsys, file):
        card = file.with_suffix(".json")
        content = json.loads(card.read_text())
        content["observation"][-1][1] = 123.0
        card.write_text(json.dumps(content))
        assert "instead of 123.0" in refusal(capsys, "--policy", file)


class TestOtherModes:
    def test_statistics_are_those_of_the_policy(self, capsys, tmp_path):
        file = save(tmp_path / "mine.safetensors", FEEDBACK)
        world = ["--randomization", "full", *SHORT]
        code, out, _ = evaluate(
            capsys, "--policy", file, *world, "--episodes", "2", "--json", "r.json",
            "--results", "log.jsonl",
        )  # fmt: skip
        assert code == 0
        assert "velocity controller, mine, randomization full" in out
        identity = read_contenders([str(file)])[0].identity
        assert json.loads((tmp_path / "r.json").read_text())["policy"] == identity
        log = tmp_path / "log.jsonl"
        header = json.loads(log.read_text().splitlines()[0])
        del header["crc32"]
        assert header["policy"] == identity
        env = make_env(JumpConfig.of(randomization="full", stand_time=0.1))
        episodes = EpisodeLog(log, header, resume=True).episodes
        assert list(episodes.values()) == [run_episode(env, seed, FEEDBACK) for seed in (0, 1)]

    def test_a_log_is_resumed_with_the_same_policy_alone(self, capsys, tmp_path):
        file = save(tmp_path / "mine.safetensors", FEEDBACK)
        arguments = ["--randomization", "full", *SHORT, "--results", "log.jsonl"]
        assert evaluate(capsys, *arguments, "--policy", file)[0] == 0
        save_constant(file, 0.1, 0, 0)
        message = refusal(capsys, *arguments, "--policy", file, "--resume")
        assert "different: policy.sha256" in message
        assert "different: policy.name, policy.sha256" in refusal(capsys, *arguments, "--resume")

    def test_view_and_video_get_the_policy_and_its_environment(
        self, capsys, tmp_path, monkeypatch
    ):
        file = save(tmp_path / "mine.safetensors", FEEDBACK, com_displacement=0.1)
        asked = []
        monkeypatch.setattr(
            view, "view", lambda config, seed, *_, policy: asked.append((config, seed, policy))
        )
        monkeypatch.setattr(video, "check_video", lambda _: None)
        monkeypatch.setattr(
            video,
            "record_video",
            lambda _, config, seed, *rest: asked.append((config, seed, rest[-1])),
        )
        common = ["--policy", file, "--seed", "3", *SHORT]
        assert evaluate(capsys, *common, "--view")[0] == 0
        assert evaluate(capsys, *common, "--video", "jump.mp4")[0] == 0
        for config, seed, policy in asked:
            assert config == JumpConfig.of(com_displacement=0.1, stand_time=0.1)
            assert seed == 3
            assert policy.card == load_policy(file).card
        assert len(asked) == 2

    def test_a_video_is_recorded_of_the_policys_jump(self, tmp_path, monkeypatch):
        pytest.importorskip("imageio.v3")

        class EnoughSeenError(Exception):
            pass

        def run(env, seed, policy, on_step):
            raise EnoughSeenError(env.config.agent_frequency, seed, policy)

        monkeypatch.setattr(video, "check_video", lambda _: None)
        monkeypatch.setattr(video, "run_episode", run)
        with pytest.raises(EnoughSeenError) as seen:
            video.record_video(tmp_path / "jump.mp4", JumpConfig(), 3, QUIET, FEEDBACK)
        assert seen.value.args == (100.0, 3, FEEDBACK)

    def test_what_is_shown_live_is_the_policys_jump(self, monkeypatch):
        """The screen wants a step per control tick; the policy acts as often as ever."""
        config = JumpConfig.of(stand_time=0.1)
        shown = []

        class Show:
            def __init__(self, env, seed, screen, playback, enough, policy, hold):
                self.run = lambda: shown.append(run_episode(env, seed, policy, hold=hold))

        monkeypatch.setattr(view, "Show", Show)
        monkeypatch.setattr(view, "in_browser", lambda: False)
        monkeypatch.setattr(view, "open_screen", lambda *_: contextlib.ExitStack())
        view.view(config, 0, QUIET, policy=FEEDBACK)
        assert shown[0].jump == run_episode(make_env(config), 0, FEEDBACK).jump
        assert shown[0].jump != run_episode(make_env(traced(config)), 0, FEEDBACK).jump

    def test_the_line_that_replays_a_failure_does(self, capsys, tmp_path, monkeypatch):
        """Also of a command drawn, a policy with its card, and a path with blanks."""
        file = save_constant(
            tmp_path / "my policies" / "a b.safetensors", 0.1, 0, 0, momentum_control=False
        )
        code, out, _ = evaluate(
            capsys, "--policy", file, "--randomization", "full", "--jump-height", "0.03", "0.05",
            "--stand-time", "1", "--episodes", "2", "--seed", "4", "--results", "log.jsonl",
        )  # fmt: skip
        assert code == 0
        command = next(line for line in out.splitlines() if "replay" in line).split("eval.py ")[1]
        asked = []
        monkeypatch.setattr(
            view, "view", lambda config, seed, *_, policy: asked.append((config, seed, policy))
        )
        assert evaluate(capsys, *shlex.split(command))[0] == 0
        ((config, seed, policy),) = asked
        assert isinstance(config.jump_height, float)
        log = tmp_path / "log.jsonl"
        header = json.loads(log.read_text().splitlines()[0])
        del header["crc32"]
        recorded = EpisodeLog(log, header, resume=True).episodes[seed]
        assert not recorded.is_success
        assert run_episode(make_env(config), seed, policy) == recorded
