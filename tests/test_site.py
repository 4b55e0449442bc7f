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


def code_cells():
    notebook = json.loads((DOCS / "notebook.ipynb").read_text(encoding="utf-8"))
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def test_the_notebook_was_executed():
    cells = code_cells()
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert all(cell["outputs"] for cell in cells[1:])
    assert not any(output["output_type"] == "error" for cell in cells for output in cell["outputs"])
    assert "/tmp" not in (DOCS / "notebook.ipynb").read_text(encoding="utf-8")


def test_the_notebook_runs(tmp_path):
    for library in ("nbclient", "ipykernel", "pandas", "xarray"):
        pytest.importorskip(library, reason=f"{library} is not installed; it comes with the extra `docs`")
    done = tmp_path / "done.ipynb"
    script = (
        "import sys, nbformat, nbclient\n"
        f"notebook = nbformat.read({str(DOCS / 'notebook.ipynb')!r}, 4)\n"
        f"nbclient.NotebookClient(notebook, timeout=300, kernel_name='python3').execute()\n"
        f"nbformat.write(notebook, {str(done)!r})\n"
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=environment, check=True, capture_output=True)
    outputs = [output for cell in json.loads(done.read_text())["cells"] for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert any("first try" in "".join(output.get("data", {}).get("text/html", "")) for output in outputs)


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


def test_the_site_builds_without_warnings_and_all_links_lead_somewhere(tmp_path):
    for library in ("mkdocs", "material", "mkdocstrings", "mkdocs_jupyter"):
        if importlib.util.find_spec(library) is None:
            pytest.skip(f"{library} is not installed; it comes with the extra `docs`")
    site = tmp_path / "site"
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(site)]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr.replace("[IPKernelApp] WARNING", "")
    # Notebook pages bring Jupyter's own markup; what is looked at is what the pages of this project refer to.
    pages = {path: Links(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    assert len(pages) > 20
    for path, page in pages.items():
        if path.name in ("404.html", "notebook.html"):
            continue
        for target in page.loaded:
            assert target.startswith("data:") or not urlsplit(target).scheme, f"{path.name} loads {target}"
        for target in [*page.loaded, *page.linked]:
            parts = urlsplit(target)
            if parts.scheme or target.startswith("data:"):
                continue
            file = path if not parts.path else (path.parent / unquote(parts.path)).resolve()
            assert file.is_file(), f"{path.relative_to(site)}: {target}"
            if parts.fragment and file in pages and file.name != "notebook.html":
                assert unquote(parts.fragment) in pages[file].names | {"__skip"}, f"{path.name}: {target}"
    assert (site / "search" / "search_index.js").read_text(encoding="utf-8").startswith("var __index = {")
    equations = (site / "equations.html").read_text(encoding="utf-8")
    assert equations.count('<div class="arithmatex">') > 12
    assert "$$" not in equations
    for name in ("case2-film.gif", "case5-film.html", "hard-thrust.png"):
        assert (site / "gallery" / name).stat().st_size > 10_000
