"""The glossary has a line for every number that a run leaves; that of a replay is held in test_replay.py."""

import importlib.util
from html import escape
from pathlib import Path

import synthetic_run

import gbt_ocp as gbt
from gbt_ocp.reporting import glossary
from gbt_ocp.reporting.run_report import report_page
from gbt_ocp.simulation.track_summary import track_numbers

DOCS = Path(__file__).resolve().parents[1] / "docs"


def test_every_key_of_a_summary_has_a_line_and_no_line_is_without_a_key(tmp_path):
    result = gbt.run("case2", overrides=["duration_s=1", "guidance={kind: static}"])
    # numbers of runs with a standoff and a forecast of 10 s
    at_sea = track_numbers(synthetic_run.history(2), 1.0, 1.0)
    found = set(result.summary) | set(at_sea) | {"vehicles", "team"}  # the last of runs with several vehicles
    assert found == set(glossary.RUN_NUMBERS)
    assert [key for key in glossary.RUN_NUMBERS if key in result.summary] == [
        key for key in result.summary if key in glossary.RUN_NUMBERS
    ]
    assert set(result.summary["fallbacks"]) == set(glossary.FALLBACK_NUMBERS)
    assert set(result.summary["retries"]) == set(glossary.RETRY_NUMBERS)
    page = report_page(result.save(tmp_path / "run", figures=False))
    for key, (_, meaning) in glossary.RUN_NUMBERS.items():
        assert key in page
        assert escape(meaning) in page
    assert "href='#glossary'" in page
    assert "id='glossary'" in page


def test_the_page_is_that_of_the_package():
    """After a change: ``python docs/write_glossary.py``."""
    spec = importlib.util.spec_from_file_location("write_glossary", DOCS / "write_glossary.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.PAGE.read_text(encoding="utf-8") == module.page(), "run: python docs/write_glossary.py"
