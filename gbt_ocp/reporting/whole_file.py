"""Files that are there whole or not at all, and texts that travel with the package."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path


@contextmanager
def whole_file(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary name beside ``target``, with its ending, that replaces it when the block ends well."""
    final = Path(target)
    final.parent.mkdir(parents=True, exist_ok=True)
    temporary = final.parent / f".{final.stem}.partial-{secrets.token_hex(4)}{final.suffix}"
    try:
        yield temporary
        os.replace(temporary, final)
    finally:
        temporary.unlink(missing_ok=True)


def packaged_text(folder: str, name: str) -> str:
    """Text of a file in a folder of `gbt_ocp.reporting`."""
    return (files("gbt_ocp.reporting") / folder / name).read_text(encoding="utf-8")
