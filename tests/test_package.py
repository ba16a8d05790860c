"""The package as a whole: layers, import costs, and the installed wheel."""

import ast
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]
PACKAGE = REPOSITORY / "icub_jump_env"

# Each layer may import itself and the layers after it.
LAYERS = (
    ("evaluation",),
    ("env",),
    ("policy",),
    ("reward", "config", "observation", "snapshot"),
    ("control", "simulation"),
    ("estimation", "reference", "metrics"),
    ("robot",),
    ("checks", "files"),
    ("errors",),
)
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}


def imports(file):
    """Absolute names that a file imports."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


FILES = sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("file", FILES, ids=lambda f: str(f.relative_to(PACKAGE)))
def test_dependencies_run_one_way(file):
    own = file.relative_to(PACKAGE).with_suffix("").parts[0]
    if own == "__init__":
        return
    for name in imports(file):
        parts = name.split(".")
        if parts[0] == "icub_jump_env" and len(parts) > 1 and parts[1] in LEVEL:
            assert LEVEL[parts[1]] >= LEVEL[own], f"{file.name} imports {name}"


@pytest.mark.parametrize("file", FILES, ids=lambda f: str(f.relative_to(PACKAGE)))
def test_only_the_simulation_knows_mujoco_figures_matplotlib_and_nobody_torch(file):
    modules = {name.split(".")[0] for name in imports(file)}
    folder = file.relative_to(PACKAGE).parts[0]
    if folder != "simulation" and file.name != "mujoco_model.py":
        assert "mujoco" not in modules
    assert not modules & {"torch", "stable_baselines3"}
    if "figures" not in file.parts:
        assert "matplotlib" not in modules


def test_every_module_is_small():
    for file in FILES:
        assert len(file.read_text().splitlines()) <= 400, file


def test_metrics_work_without_the_environment_and_the_simulator():
    program = (
        "import sys, types\n"
        "package = types.ModuleType('icub_jump_env')\n"
        f"package.__path__ = [{str(PACKAGE)!r}]\n"
        "sys.modules['icub_jump_env'] = package\n"
        "import icub_jump_env.metrics.jump\n"
        "assert not {'mujoco', 'gymnasium', 'pinocchio'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_importing_registers_and_loads_nothing_heavy():
    program = (
        "import icub_jump_env, gymnasium, sys\n"
        "assert 'ICubJump-v0' in gymnasium.registry\n"
        "assert not {'torch', 'stable_baselines3', 'matplotlib', 'mujoco'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_the_default_environment_loads_no_osqp():
    program = (
        "import sys, gymnasium, icub_jump_env\n"
        "assert not {'osqp', 'joblib'} & set(sys.modules)\n"
        "gymnasium.make('ICubJump-v0').reset(seed=0)\n"
        "assert not {'osqp', 'joblib'} & set(sys.modules)\n"
        "gymnasium.make('ICubJump-v0', solver='osqp')\n"
        "assert 'osqp' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [
            sys.executable,
            "-m",
            "pip",
            "wheel",
            "-q",
            "--no-deps",
            "-w",
            str(folder),
            str(REPOSITORY),
        ],
        check=True,
    )
    return next(folder.glob("*.whl"))


def test_wheel_ships_the_package_alone(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0].split("-")[0] for name in names} == {"icub_jump_env", "icub_jump"}
    assert "icub_jump_env/py.typed" in names
    assert any(name.endswith("LICENSE") for name in names)
    assert not [name for name in names if Path(name).suffix in (".stl", ".urdf", ".dae", ".png")]


def test_installed_wheel_jumps(wheel, tmp_path):
    """The wheel, not the checkout: unpacked elsewhere and found first."""
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    program = (
        "import sys\n"
        f"sys.path.insert(0, {str(tmp_path / 'site')!r})\n"
        "import gymnasium, icub_jump_env, numpy as np\n"
        f"assert icub_jump_env.__file__.startswith({str(tmp_path)!r})\n"
        "env = gymnasium.make('ICubJump-v0', stand_time=0.2); env.reset(seed=0); done = False\n"
        "while not done:\n"
        "    *_, done, _, info = env.step(np.zeros(3, np.float32))\n"
        "assert info['is_success']\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, cwd=tmp_path)
