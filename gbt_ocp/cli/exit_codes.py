"""Exit codes of ``gbt-ocp``."""

from __future__ import annotations

DONE = 0
"""Done."""

PROGRAM_FAULT = 1
"""A fault of the program, or a sweep with runs that failed."""

WRONG_INPUT = 2
"""The input is wrong, or what is asked for cannot be written; one line a fault."""

LIMIT_BROKEN = 3
"""The run finished but broke a stated limit; or the generated C does not do what was recorded."""

INTERRUPTED = 4
"""Interrupted; what was finished is kept."""
