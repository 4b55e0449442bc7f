"""The documentation site: its drawing, its notebook, and a strict build."""

import importlib.util
import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"


@pytest.mark.long
def test_the_drawing_of_the_rooms_is_that_of_the_code():
    """After a change: ``python docs/draw_rooms.py``."""
    spec = importlib.util.spec_from_file_location("draw_rooms", DOCS / "draw_rooms.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.DRAWING.read_text(encoding="utf-8") == module.drawing(), "run: python docs/draw_rooms.py"


def test_the_navigation_names_pages_that_there_are():
    """Pages that it does not name are added by docs/build_hooks.py, which makes two of them as well."""
    named = re.findall(
        r"^ +- .*: (\S+\.(?:md|ipynb))$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert len(named) > 15
    for name in named:
        assert name in ("gallery/index.md", "command-line.md") or (DOCS / name).is_file(), name


def test_the_python_reference_is_that_of_the_public_rooms():
    """After a change: ``python docs/write_api.py``."""
    spec = importlib.util.spec_from_file_location("write_api", DOCS / "write_api.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for name, text in module.pages().items():
        assert (DOCS / name).read_text(encoding="utf-8") == text, "run: python docs/write_api.py"


NOTEBOOKS = [path.relative_to(DOCS).as_posix() for path in sorted(DOCS.rglob("*.ipynb"))]


def code_cells(name):
    notebook = json.loads((DOCS / name).read_text(encoding="utf-8"))
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_was_executed_and_is_in_the_index(name):
    index = DOCS / "examples" / "index.md"
    assert f"]({os.path.relpath(DOCS / name, index.parent)})".replace(os.sep, "/") in index.read_text(encoding="utf-8")
    cells = code_cells(name)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert cells[-1]["outputs"]
    assert not any(output["output_type"] == "error" for cell in cells for output in cell["outputs"])
    assert "/tmp" not in (DOCS / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", NOTEBOOKS)
@pytest.mark.long
def test_a_notebook_runs(tmp_path, name):
    for library in ("nbclient", "ipykernel", "pandas", "xarray"):
        pytest.importorskip(library, reason=f"{library} is not installed; it comes with the extra `docs`")
    done = tmp_path / "done.ipynb"
    script = (
        "import sys, nbformat, nbclient\n"
        f"notebook = nbformat.read({str(DOCS / name)!r}, 4)\n"
        f"nbclient.NotebookClient(notebook, timeout=300, kernel_name='python3').execute()\n"
        f"nbformat.write(notebook, {str(done)!r})\n"
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=environment, check=True, capture_output=True)
    outputs = [output for cell in json.loads(done.read_text())["cells"] for output in cell.get("outputs", ())]
    shown = json.dumps(outputs)
    for said in {"notebook.ipynb": ["image/png", "first try"], "examples/log.ipynb": ["image/png", "of the truth"]}.get(
        name, ["solved"]
    ):
        assert said in shown


class Links(HTMLParser):
    """What a page refers to and what can be referred to in it."""

    def __init__(self, text):
        super().__init__()
        self.loaded, self.linked, self.names = [], [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.names |= {found[key] for key in ("id", "name") if found.get(key)}
        if tag == "a" and found.get("href"):
            self.linked.append(found["href"])
        if found.get("src"):
            self.loaded.append(found["src"])
        if tag == "link" and found.get("rel") in ("stylesheet", "icon") and found.get("href"):
            self.loaded.append(found["href"])


def is_notebook(page, site):
    return page.with_suffix(".ipynb").relative_to(site.resolve()).as_posix() in NOTEBOOKS


@pytest.mark.slow
def test_the_site_builds_without_warnings_and_all_links_lead_somewhere(tmp_path):
    for library in ("mkdocs", "material", "mkdocstrings", "mkdocs_jupyter"):
        if importlib.util.find_spec(library) is None:
            pytest.skip(f"{library} is not installed; it comes with the extra `docs`")
    site = (tmp_path / "site").resolve()
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(site)]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr.replace("[IPKernelApp] WARNING", "")
    # Notebook pages bring Jupyter's own markup; what is looked at is what the pages of this project refer to.
    pages = {path: Links(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    assert len(pages) > 20
    for path, page in pages.items():
        if path.name == "404.html" or is_notebook(path, site):
            continue
        for target in page.loaded:
            assert target.startswith("data:") or not urlsplit(target).scheme, f"{path.name} loads {target}"
        for target in [*page.loaded, *page.linked]:
            parts = urlsplit(target)
            if parts.scheme or target.startswith("data:"):
                continue
            file = path if not parts.path else (path.parent / unquote(parts.path)).resolve()
            assert file.is_file(), f"{path.relative_to(site)}: {target}"
            if parts.fragment and file in pages and not is_notebook(file, site):
                assert unquote(parts.fragment) in pages[file].names | {"__skip"}, f"{path.name}: {target}"
    assert (site / "search" / "search_index.js").read_text(encoding="utf-8").startswith("var __index = {")
    equations = (site / "equations.html").read_text(encoding="utf-8")
    assert equations.count('<div class="arithmatex">') > 12
    assert "$$" not in equations
    for name in ("case2-film.gif", "case5-film.html", "hard-thrust.png", "sea-range.png"):
        assert (site / "gallery" / name).stat().st_size > 10_000
