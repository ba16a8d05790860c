"""The public names: the documents list them, use no others, and say what each is."""

import importlib
import json
import re
from pathlib import Path

import icub_jump_env

REPOSITORY = Path(__file__).parents[1]
REFERENCE = REPOSITORY / "docs" / "reference"
MODULES = sorted(
    name
    for page in REFERENCE.glob("*.md")
    for name in re.findall(r"automodule:: (\S+)", page.read_text())
)
IMPORT = re.compile(r"^ *from (icub_jump_env[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


def texts():
    """Documents, notebooks and examples, by name."""
    files = [REPOSITORY / "README.md", *(REPOSITORY / "docs").rglob("*.md")]
    files += (REPOSITORY / "examples").rglob("*.py")
    found = {str(file.relative_to(REPOSITORY)): file.read_text() for file in files}
    for file in (REPOSITORY / "docs").rglob("*.ipynb"):
        cells = json.loads(file.read_text())["cells"]
        code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
        found[str(file.relative_to(REPOSITORY))] = "\n".join(code)
    return found


def test_the_page_lists_what_the_package_offers():
    listed = re.search(r"itself: (.*?)\.\n\n", (REFERENCE / "public.md").read_text(), re.DOTALL)
    assert sorted(re.findall(r"`(\w+)`", listed[1])) == sorted(icub_jump_env.__all__)
    for name in icub_jump_env.__all__:
        assert getattr(icub_jump_env, name) is not None


def test_documents_and_examples_use_public_names():
    used = [
        (place, module, name)
        for place, text in texts().items()
        for module, names in IMPORT.findall(text)
        for name in re.findall(r"\w+", re.sub(r" as \w+|#.*", "", names))
    ]
    assert len(used) > 40
    for place, module, name in used:
        if module == "icub_jump_env":
            assert name in icub_jump_env.__all__, (place, name)
        else:
            assert module in MODULES, (place, module)
            assert hasattr(importlib.import_module(module), name), (place, module, name)
            assert not name.startswith("_"), (place, name)
