"""Documents: their generated parts are current and regenerate to themselves."""

import importlib.util
import re
import shlex
from pathlib import Path

import pytest

from icub_jump_env import observation
from icub_jump_env.control import catching, flight, landing
from icub_jump_env.control.config import TorqueConfig, VelocityConfig
from icub_jump_env.evaluation import cli
from icub_jump_env.evaluation.options import EvalOptions
from icub_jump_env.planning.scaled_curve import RETRACTION_TIME
from icub_jump_env.simulation import tables
from icub_jump_env.simulation.actuators.servo import ServoGains

REPOSITORY = Path(__file__).parents[1]
DOCUMENTS = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").rglob("*.md"))]

spec = importlib.util.spec_from_file_location("update", REPOSITORY / "docs" / "update.py")
update = importlib.util.module_from_spec(spec)
spec.loader.exec_module(update)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: str(d.relative_to(REPOSITORY)))
def test_regenerating_changes_only_the_blocks(document):
    text = document.read_text()

    def output(command):
        table = any(word in command for word in ("observation", "tables", "clients"))
        return "| new |" if table else "first\n\nlast, new"

    def updated(text):
        return update.BLOCK.sub(lambda block: update.fresh(block, output), text)

    once = updated(text)
    assert updated(once) == once
    assert once.count("new |") + once.count("last, new") == len(
        re.findall("^`python [^`]*`$", text, re.M)
    )
    assert update.BLOCK.sub("", once) == update.BLOCK.sub("", text)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: str(d.relative_to(REPOSITORY)))
def test_readers_see_each_command(document):
    assert "<!--" not in document.read_text()


def test_the_observation_table_is_current():
    document = (REPOSITORY / "docs" / "environment.md").read_text()
    assert observation.layout_table() in document


def test_the_preset_tables_are_current():
    document = (REPOSITORY / "docs" / "simulation.md").read_text()
    for kind in tables.PRESETS:
        assert tables.preset_table(kind) in document


def test_the_readme_shows_what_the_command_prints():
    """To two units of the last decimal: other processors round differently."""
    readme = (REPOSITORY / "README.md").read_text()
    shown = re.search(r"^`python eval\.py`\n\n```\n(.*?)```", readme, re.DOTALL | re.M)[1].split()
    printed = update.output_of("python eval.py").split()
    assert len(shown) == len(printed)
    for ours, theirs in zip(shown, printed, strict=True):
        number = re.fullmatch(r"[+-]?\d+\.(\d+)", ours)
        if number:
            tolerance = 2.01 * 10.0 ** -len(number[1])
            assert float(theirs) == pytest.approx(float(ours), abs=tolerance)
        else:
            assert ours == theirs


def test_the_readme_shows_the_table_once():
    readme = (REPOSITORY / "README.md").read_text()
    assert readme.count("flight height (CoM), cm") == 1


def test_help_runs_no_command(capsys, monkeypatch):
    monkeypatch.setattr(update, "fresh", pytest.fail)
    with pytest.raises(SystemExit) as end:
        update.main(["--help"])
    assert end.value.code == 0
    assert "python docs/update.py" in capsys.readouterr().out
    with pytest.raises(SystemExit) as end:
        update.main(["--hepl"])
    assert end.value.code == 2


def test_nothing_advises_to_install_the_package_from_an_index():
    sources = [
        file
        for folder in ("icub_jump_env", "agents")
        for file in (REPOSITORY / folder).rglob("*.py")
    ]
    for file in (*sources, *DOCUMENTS):
        assert not re.search(r"pip install (?!git\+)[^\n`]*icub-jump\b(?!-)", file.read_text()), (
            file
        )


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: str(d.relative_to(REPOSITORY)))
def test_every_command_of_eval_parses(document):
    text = document.read_text().replace("\\\n", " ")  # a command may go on in the next line
    for line in re.findall(r"python eval\.py([^#`\n]*)", text):
        arguments = shlex.split(line)
        if arguments != ["--help"]:
            cli.parse(EvalOptions, arguments)


def anchors(document):
    """Those that GitHub makes of the headings."""
    headings = re.findall(r"^#+ (.+)$", document.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: str(d.relative_to(REPOSITORY)))
def test_links_lead_somewhere(document):
    for link in re.findall(r"\]\(([^)\s]+)\)", document.read_text()):
        name, _, anchor = link.partition("#")
        if "://" in name:
            continue
        file = document.parent / name if name else document
        assert file.exists(), link
        assert not anchor or anchor in anchors(file), link


def test_the_controller_page_states_the_gains_in_use():
    page = (REPOSITORY / "docs" / "controller.md").read_text()
    velocity, torque, servo = VelocityConfig(), TorqueConfig(), ServoGains()
    contact, phases = torque.contact, velocity.phases
    for statement in (
        f"weight {velocity.com_weight:.0e}".replace("e+0", "e"),
        f"weight {velocity.momentum_weight:.0e}".replace("e+0", "e"),
        f"both {velocity.com:g} 1/s",
        f"speed limits x {velocity.velocity_margin:g}",
        f"look {velocity.limit_horizon * 1e3:g} ms ahead",
        f"weight {torque.com_weight:.0e}".replace("e+0", "e"),
        f"weight {torque.momentum_weight:.0e}".replace("e+0", "e"),
        f"hold after {torque.speed_horizon * 1e3:g} ms",
        f"position limits after {torque.limit_horizon * 1e3:g} ms",
        f"friction pyramid {contact.friction:g}",
        f"torsion {contact.torsional_friction:g} m",
        f"at least {contact.minimum_force:g} N",
        f"({servo.stiffness:g} Nm/rad, {servo.damping:g} Nm s/rad)",
        f"less than {phases.lift_off:g} N",
        f"({phases.touch_down:g} N)",
        f"motion of {RETRACTION_TIME:g} s",
    ):
        assert statement in page, statement
    assert velocity.com == velocity.momentum
    assert torque.phases == phases


def test_the_landing_page_states_the_gains_in_use():
    page = " ".join((REPOSITORY / "docs" / "landing.md").read_text().split())
    forward, sideways = (100 * farthest for farthest in flight.FARTHEST)
    for statement in (
        f"predicted by {1e3 * flight.LEAD:g} ms",
        f"{forward:g} cm forward or back, {sideways:g} cm sideways",
        f"legs extend by {100 * flight.EXTENSION:g} cm",
        f"give way {1e3 * flight.YIELD_TIME:g} ms before",
        f"up to {flight.YIELD_SHARE:g} of the speed of the fall",
        f"wait for {1e3 * flight.OVERSHOOT_TIME:g} ms",
        f"stop after {100 * flight.FARTHEST_YIELD:g} cm",
        f"within {flight.SPEED_SHARE:g} of theirs",
        f"({catching.CAPTURE_GAIN:g} 1/s; sideways {catching.LATERAL_CAPTURE_GAIN:g} 1/s)",
        f"{1e3 * catching.SIDE_MARGIN:g} mm within its sides",
        f"shift it by up to {100 * catching.FARTHEST_SHIFT:g} cm",
        f"{1e3 * landing.STAND_AHEAD:g} mm ahead of the middle of the soles",
        f"braked within {landing.BRAKING_TIME:g} s",
        f"landing posture in {landing.RISING_TIME:g} s",
    ):
        assert statement in page, statement
