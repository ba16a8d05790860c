"""Pictures: in a process of their own, because MuJoCo chooses its OpenGL when imported."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import gymnasium, icub_jump_env, numpy as np
plain = gymnasium.make("ICubJump-v0")
pretty = gymnasium.make("ICubJump-v0", render_mode="rgb_array")
states = []
for env in (plain, pretty):
    env.reset(seed=0)
    first = env.render() if env is pretty else None
    for _ in range(50):
        env.step(np.zeros(3, np.float32))
    states.append(env.unwrapped.data.qpos.copy())
picture = env.render()
assert picture.shape == (480, 640, 3) and picture.dtype == np.uint8
red = (picture[..., 0] > 120) & (picture[..., 1] < 80)
assert 0.01 < red.mean() < 0.5, "the iCub's red shells should fill part of the picture"
assert (picture != first).any(), "the robot should have moved"
assert (states[0] == states[1]).all(), "looks must not change the physics"
pretty.close(); pretty.close()
print("rendered")
"""


@pytest.fixture(scope="module")
def offscreen():
    probe = (
        "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>')); print('ok')"
    )
    environment = {**os.environ, "MUJOCO_GL": "egl"}
    result = subprocess.run(
        [sys.executable, "-c", probe], env=environment, capture_output=True, text=True, check=False
    )
    if "ok" not in result.stdout:
        pytest.skip("no EGL on this machine")
    return environment


def test_pictures_show_the_robot_and_change_nothing(offscreen):
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=offscreen, capture_output=True, text=True, check=False
    )
    assert result.stdout.strip() == "rendered", result.stderr


def test_video_is_recorded(offscreen, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    file = tmp_path / "jump.mp4"
    program = (
        "from icub_jump_env.evaluation.modes.video import record_video\n"
        "from icub_jump_env.config import JumpConfig\n"
        "from rich.console import Console\n"
        "from pathlib import Path\n"
        "import imageio.v3 as iio\n"
        f"file = Path({str(file)!r})\n"
        "record_video(file, JumpConfig.of(stand_time=0.1, agent_frequency=25.0), 0, Console())\n"
        "print(*iio.imread(file).shape)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], env=offscreen, check=True, capture_output=True, text=True
    )
    frames, *shape = (int(word) for word in result.stdout.split())
    assert 16 < frames < 22  # 0.73 s at 25 pictures a second
    assert shape == [480, 640, 3]


@pytest.mark.parametrize(
    ("mode", "backend", "remedy"),
    [("human", "", "that needs a display"), ("rgb_array", "glfw", "unset it to render with EGL")],
)
def test_without_a_display_the_error_names_the_remedy(mode, backend, remedy):
    program = (
        "import gymnasium, icub_jump_env\n"
        f"env = gymnasium.make('ICubJump-v0', render_mode={mode!r})\n"
        "try:\n"
        "    env.reset(seed=0); env.render()\n"
        "except icub_jump_env.MissingDependencyError as error:\n"
        "    print(error)\n"
    )
    display = ("DISPLAY", "WAYLAND_DISPLAY")
    environment = {k: v for k, v in os.environ.items() if k not in display}
    environment["MUJOCO_GL"] = backend
    result = subprocess.run(
        [sys.executable, "-c", program],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert remedy in result.stdout


def test_two_environments_render_side_by_side(offscreen):
    program = (
        "import gymnasium, icub_jump_env, numpy as np\n"
        "envs = [gymnasium.make('ICubJump-v0', render_mode='rgb_array') for _ in range(2)]\n"
        "pictures = [(env.reset(seed=0), env.render())[1] for env in envs]\n"
        "assert (pictures[0] == pictures[1]).all()\n"
        "envs[0].close()\n"
        "assert np.abs(envs[1].render().astype(int) - pictures[1]).max() <= 1\n"
        "envs[1].close()\n"
    )
    subprocess.run([sys.executable, "-c", program], env=offscreen, check=True)


def test_size_and_camera_are_those_asked_for(offscreen):
    """Through gymnasium.make, by shortcuts and as a group."""
    program = (
        "import gymnasium, icub_jump_env, numpy as np\n"
        "def picture(**given):\n"
        "    env = gymnasium.make('ICubJump-v0', **given)\n"
        "    env.reset(seed=0)\n"
        "    shown = env.render()\n"
        "    env.close()\n"
        "    return shown\n"
        "size = {'width': 160, 'height': 96}\n"
        "shown = [\n"
        "    picture(render_mode='rgb_array', **size),\n"
        "    picture(render_mode='rgb_array', camera='front', **size),\n"
        "    picture(rendering={'mode': 'rgb_array', 'camera': 'profile', **size}),\n"
        "]\n"
        "assert all(p.shape == (96, 160, 3) for p in shown)\n"
        "for one, other in ((0, 1), (1, 2), (2, 0)):\n"
        "    differs = (shown[one] != shown[other]).any(axis=2)\n"
        "    assert differs.mean() > 0.05, (one, other)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], env=offscreen, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
