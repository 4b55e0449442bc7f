"""``gbt-ocp new``: a problem of the user's own to start from."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from gbt_ocp.experiments.config.faults import ConfigurationError


def write_problem(path: Path) -> Path:
    """Write the commented starting point to a new file, and return its path.

    Raises
    ------
    ConfigurationError
        If the name does not end in ``.py``, the file is there already, or it cannot be written.
    """
    if path.suffix != ".py":
        raise ConfigurationError([f"FILE.py: found {path}; allowed: a name that ends in .py"])
    text = (files(__name__) / "problem.py").read_text(encoding="utf-8")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text.replace("my_problem", path.stem))
    except FileExistsError:
        raise ConfigurationError([f"FILE.py: found {path}, which exists already; allowed: a new file"]) from None
    except OSError as fault:
        raise ConfigurationError([f"FILE.py: found {path} ({fault}); allowed: a file that can be written"]) from fault
    return path
