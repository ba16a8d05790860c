"""The package as a whole: layers, import costs, and the installed wheel."""

import ast
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from icub_jump_env.policy import shipped_policies

REPOSITORY = Path(__file__).parents[1]
PACKAGE = REPOSITORY / "icub_jump_env"

# Each layer may import itself and the layers after it.
LAYERS = (
    ("cli",),
    ("benchmark", "export"),
    ("evaluation",),
    ("vector",),
    ("env",),
    ("policy",),
    ("config", "observation", "snapshot"),
    ("shortcuts",),
    ("reward", "simulation"),
    ("control",),
    ("estimation", "planning", "metrics"),
    ("robot",),
    ("mappings", "linear_algebra", "records"),
    ("compiled",),
    ("checks", "files", "carded", "versions", "workers"),
    ("errors",),
)
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}


def imports(file):
    """Absolute names that a file imports."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


FILES = sorted(PACKAGE.rglob("*.py"))
AGENTS = sorted((REPOSITORY / "agents").glob("*.py"))


@pytest.mark.parametrize("file", FILES, ids=lambda f: str(f.relative_to(PACKAGE)))
def test_dependencies_run_one_way(file):
    own = file.relative_to(PACKAGE).with_suffix("").parts[0]
    if own == "__init__" or file.name == "__main__.py":  # a command uses whatever it needs
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
        "import icub_jump_env.metrics.series\n"
        "assert not {'mujoco', 'gymnasium', 'pinocchio'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_importing_registers_and_loads_nothing_heavy():
    program = (
        "import icub_jump_env, gymnasium, sys\n"
        "assert 'ICubJump-v0' in gymnasium.registry\n"
        "heavy = {'torch', 'stable_baselines3', 'matplotlib', 'mujoco', 'numba', 'pinocchio', 'scipy'}\n"
        "assert not heavy & set(sys.modules)\n"
        "assert all(hasattr(icub_jump_env, name) for name in icub_jump_env.__all__)\n"
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
    assert sum(name.endswith("LICENSE") for name in names) == 2  # of the code, of the pictures
    assert not [name for name in names if Path(name).suffix in (".stl", ".urdf", ".dae", ".png")]


def test_links_of_the_description_lead_somewhere_on_any_page(wheel):
    content = zipfile.ZipFile(wheel)
    (name,) = [name for name in content.namelist() if name.endswith("METADATA")]
    targets = re.findall(r"\]\(([^)]+)\)", content.read(name).decode())
    assert len(targets) > 20
    assert all(target.startswith(("https://", "#")) for target in targets)


def test_wheel_ships_the_agents_the_policies_and_the_command(wheel):
    content = zipfile.ZipFile(wheel)
    names = set(content.namelist())
    folder = REPOSITORY / "agents"
    agents = {
        f"icub_jump_env/agents/{file.relative_to(folder)}"
        for file in folder.rglob("*")
        if file.suffix in (".py", ".yml", ".json")
    }
    assert agents == {name for name in names if name.startswith("icub_jump_env/agents/")}
    folder = "icub_jump_env/policy/shipped"
    assert {name for name in names if name.startswith(folder)} == {
        f"{folder}/{policy}.{suffix}"
        for policy in shipped_policies()
        for suffix in ("json", "safetensors")
    }
    (entries,) = [name for name in names if name.endswith("entry_points.txt")]
    assert "icub-jump = icub_jump_env.cli:main" in content.read(entries).decode()


@pytest.mark.parametrize("file", AGENTS, ids=lambda f: f.name)
def test_agents_name_each_other_relatively(file):
    """Their package is called otherwise in the wheel."""
    assert not [name for name in imports(file) if name.split(".")[0] == "agents"]


@pytest.fixture(scope="module")
def site(wheel, tmp_path_factory):
    """The wheel, unpacked."""
    folder = tmp_path_factory.mktemp("site")
    zipfile.ZipFile(wheel).extractall(folder)
    return folder


def run_installed(site, program):
    """Run a program that finds the wheel, not the checkout."""
    found = (
        "import sys\n"
        f"sys.path.insert(0, {str(site)!r})\n"
        "import icub_jump_env\n"
        f"assert icub_jump_env.__file__.startswith({str(site)!r})\n"
    )
    return subprocess.run(
        [sys.executable, "-c", found + program], check=True, capture_output=True, text=True
    )


def test_installed_command_evaluates_and_trains(site):
    names = [f"icub_jump_env.agents.{file.stem}" for file in AGENTS if file.stem != "__init__"]
    program = (
        "import importlib, importlib.util\n"
        "from icub_jump_env import cli\n"
        "from icub_jump_env.policy import load_policy\n"
        "assert load_policy('torque').card.config.controller_name == 'torque'\n"
        "for words in (['train', '--help'], ['eval', '--policy', 'torque', '--no-ankle-shift']):\n"
        "    sys.argv[1:] = words\n"
        "    try: cli.main()\n"
        "    except SystemExit as end: print('exit code', end.code or 0)\n"
        "assert 'torch' not in sys.modules\n"
        f"for name in {names}:\n"
        f"    assert importlib.import_module(name).__file__.startswith({str(site)!r})\n"
        "assert 'agents' not in sys.modules\n"
    )
    result = run_installed(site, program)
    trained, evaluated, _ = result.stdout.split("exit code ")
    assert "--ppo.log-std" in trained
    assert (evaluated.strip(), result.stdout.strip()[-1]) == ("0", "2")
    assert result.stderr.startswith("error: torque: ")
    assert "ankle_shift=False instead of True" in result.stderr


def pinned(name):
    """Versions in a file of requirements, by package."""
    text = (REPOSITORY / name).read_text()
    return dict(re.findall(r"^([\w.-]+)==([^ ;\\\n]+)", text, re.MULTILINE))


@pytest.mark.parametrize(
    ("file", "without"), [("locked.txt", ()), ("locked-tests.txt", ("torch",))]
)
def test_each_locked_version_is_the_tested_one_and_has_its_hash(file, without):
    locked, wanted = pinned(file), pinned("constraints.txt")
    assert locked.items() >= {(name, wanted[name]) for name in locked.keys() & wanted.keys()}
    entries = re.split(r"^(?=[\w.-]+==)", (REPOSITORY / file).read_text(), flags=re.MULTILINE)[1:]
    assert len(entries) >= len(locked) > 30
    assert all("--hash=sha256:" in entry for entry in entries)
    assert not locked.keys() & set(without)


def test_all_that_is_asked_for_is_locked():
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    tests = [need for name, needs in extras.items() if name != "planning" for need in needs]
    for file, needs in (("locked.txt", []), ("locked-tests.txt", tests)):
        named = {re.match(r"[\w.-]+", need)[0] for need in (*project["dependencies"], *needs)}
        assert named - {"torch"} <= pinned(file).keys()
