"""Documents: their generated parts are current and regenerate to themselves."""

import importlib.util
import re
from pathlib import Path

import pytest

from icub_jump_env import observation
from icub_jump_env.evaluation import cli

REPOSITORY = Path(__file__).parents[1]
DOCUMENTS = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").glob("*.md"))]

spec = importlib.util.spec_from_file_location("update", REPOSITORY / "docs" / "update.py")
update = importlib.util.module_from_spec(spec)
spec.loader.exec_module(update)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: d.name)
def test_regenerating_changes_only_the_blocks(document):
    text = document.read_text()

    def output(command):
        return "| new |" if "observation" in command else "first\n\nlast, new"

    once = update.updated(text, output)
    assert update.updated(once, output) == once
    assert once.count("new |") + once.count("last, new") == text.count("<!-- python ")
    assert update.BLOCK.sub("", once) == update.BLOCK.sub("", text)


def test_the_observation_table_is_current():
    document = (REPOSITORY / "docs" / "environment.md").read_text()
    assert observation.layout_table() in document


def test_the_readme_shows_the_table_once():
    readme = (REPOSITORY / "README.md").read_text()
    assert readme.count("flight height (CoM), cm") == 1


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: d.name)
def test_every_command_of_eval_parses(document):
    for line in re.findall(r"python eval\.py([^#`\n]*)", document.read_text()):
        arguments = line.split(" -->")[0].split()
        if arguments != ["--help"]:
            cli.parse(cli.EvalOptions, arguments)
