"""What the pages of the Python reference do with docstrings."""

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("griffe", reason="comes with the extra docs")


def module():
    path = Path(__file__).resolve().parents[1] / "docs" / "returns.py"
    spec = importlib.util.spec_from_file_location("returns", path)
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def test_free_text_of_what_is_returned_stands_below_the_annotation():
    text = "Do it.\n\nReturns\n-------\nThe mean, and\nits deviation.\n\nRaises\n------\nValueError\n    If not.\n"
    expected = text.replace("The mean, and\nits deviation.", "Array\n    The mean, and\n    its deviation.")
    assert module().typed(text, "Array") == expected


def test_what_is_described_in_the_style_of_numpy_stays():
    text = "Do it.\n\nReturns\n-------\nArray\n    The mean.\n"
    assert module().typed(text, "list") == text
    assert module().typed("Do it.\n", "Array") == "Do it.\n"
