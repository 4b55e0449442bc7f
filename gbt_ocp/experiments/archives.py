"""Arrays out of ``.npz`` files that may be damaged."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def read_arrays(path: str | os.PathLike[str], names: Iterable[str], kind: str) -> dict[str, NDArray[Any]]:
    """Arrays of an ``.npz`` by name; what stands beside them is passed over.

    Parameters
    ----------
    path
        The file.
    names
        Of the arrays.
    kind
        What the file should be, for the line that says that it is none.

    Raises
    ------
    ValueError
        If the file is no ``.npz``, is damaged, or an array is missing; the line names the file.
    OSError
        If it cannot be opened.
    """
    wanted = list(names)
    # Opened here: given a path, np.load leaves a damaged file open.
    with Path(path).open("rb") as stream:
        try:
            with np.load(stream, allow_pickle=False) as archive:
                missing = [name for name in wanted if name not in archive.files]
                if missing:
                    raise ValueError(f"missing arrays: {', '.join(missing)}")
                return {name: archive[name] for name in wanted}
        except Exception as fault:
            # Bytes that are not what was written make zipfile, zlib and numpy raise almost anything: RuntimeError
            # (encrypted), NotImplementedError (another compression), MemoryError (a shape of billions), OSError (a
            # place before the beginning).
            reason = " ".join(str(fault).split()) or type(fault).__name__
            raise ValueError(f"{os.fspath(path)}: not {kind}: {reason}") from None
