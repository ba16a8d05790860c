"""The documentation site: it builds without a warning, needs no network, and its code runs."""

import os
import re
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

REPOSITORY = Path(__file__).parents[1]
DOCS = REPOSITORY / "docs"
TUTORIALS = sorted((DOCS / "tutorials").glob("*.ipynb"))
WITH_CODE = ("index", "environment", "controller", "planning", "landing", "simulation", "learning")
PAGES = [*(DOCS / f"{name}.md" for name in WITH_CODE), *sorted((DOCS / "howto").glob("*.md"))]
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    words = ["-m", "sphinx", "-q", "--fail-on-warning", "--keep-going", DOCS, folder / "html"]
    built = subprocess.run(
        [sys.executable, *words, "-d", folder / "doctrees"], capture_output=True, text=True
    )
    assert built.returncode == 0, built.stderr
    return folder / "html"


def test_every_document_is_a_page(site):
    for source in [*DOCS.rglob("*.md"), *TUTORIALS]:
        assert (site / source.relative_to(DOCS).with_suffix(".html")).exists(), source


def test_a_page_loads_nothing_from_elsewhere(site):
    for page in site.rglob("*.html"):
        loaded = re.findall(
            r'<(?:script|img|link|iframe)\b[^>]*(?:src|href)="([^"]+)"', page.read_text()
        )
        assert loaded
        assert not [address for address in loaded if "//" in address], page


def test_links_within_the_site_lead_somewhere(site):
    for page in site.rglob("*.html"):
        for link in re.findall(r'(?:href|src)="([^"#?]+)', page.read_text()):
            if ":" not in link:
                assert (page.parent / link).exists(), (page, link)


def test_equations_are_shown(site):
    page = (site / "theory.html").read_text()
    assert page.count('<math xmlns="http://www.w3.org/1998/Math/MathML" display="block">') > 10
    assert "\\dot" not in page


def test_constants_keep_their_sentence(site):
    """Napoleon would take what is before a colon for a type."""
    page = (site / "reference" / "planning.html").read_text()
    assert "Decelerates before take-off, so that a final acceleration of -g can be reached" in page


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_code_of_a_page_runs(page, tmp_path):
    blocks = BLOCK.findall(page.read_text())
    code = "\n".join(blocks)
    ran = subprocess.run(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", code],
        cwd=tmp_path, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    if "print(" in code:
        assert ran.stdout


@pytest.mark.parametrize("file", TUTORIALS, ids=lambda file: file.stem)
def test_a_tutorial_says_what_it_says(file, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    kept = nbformat.read(file, as_version=4)
    fresh = nbformat.read(file, as_version=4)
    NotebookClient(fresh, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    for before, now in zip(kept.cells, fresh.cells, strict=True):
        if (
            "6,000 steps" not in before.source
        ):  # what little learning comes to differs by processor
            assert printed(before) == printed(now)


def printed(cell):
    """What a cell prints, in however many pieces it came."""
    outputs = cell.get("outputs", ())
    return "".join(output["text"] for output in outputs if output.get("name") == "stdout")
