"""Damage to the files of a folder: deleted, emptied, cut, overwritten, or replaced by valid data of another kind."""

import csv
import io
import json
import shutil
from pathlib import Path

import numpy as np

PLAIN = ("deleted", "emptied", "halved", "random", "flipped", "a folder")
"""What can happen to a file of any kind."""

TEXTS = {
    ".json": {"a list": "[]", "an empty object": "{}", "a number": "3", "null": "null"},
    ".yaml": {"a list": "- 1\n", "a text": "just words\n", "an empty mapping": "{}\n", "a tag": "!!python/none x\n"},
}
"""Valid data of another kind, whatever the file held."""


def files(folder: Path) -> list[str]:
    """All files below a folder, by relative names in a fixed order."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def damages(path: Path) -> list[str]:
    """Ways in which this file can be damaged."""
    found = [*PLAIN, *TEXTS.get(path.suffix, ())]
    if path.suffix == ".json" and path.read_text(encoding="utf-8").startswith("{"):
        found += ["without half of its keys", "texts for numbers"]
    if path.suffix == ".npz":
        found += ["without an array", "words for an array", "one row less", "one axis more", "one coordinate"]
    if path.suffix == ".csv":
        found += ["without a column", "without its last row", "words for numbers"]
    return found


def damage(path: Path, how: str, seed: int = 0) -> None:
    """Damage a file."""
    rng = np.random.default_rng(seed)
    whole = path.read_bytes()
    if how == "deleted":
        path.unlink()
    elif how == "emptied":
        path.write_bytes(b"")
    elif how == "halved":
        path.write_bytes(whole[: len(whole) // 2])
    elif how == "random":
        path.write_bytes(rng.bytes(max(len(whole), 1)))
    elif how == "flipped":
        spoilt = np.frombuffer(whole, dtype=np.uint8).copy()
        places = rng.integers(0, spoilt.size, min(20, spoilt.size))
        spoilt[places] = rng.integers(0, 256, places.size)
        path.write_bytes(spoilt.tobytes())
    elif how == "a folder":
        path.unlink()
        path.mkdir()
        (path / "inside").write_text("something")
    elif how in TEXTS.get(path.suffix, ()):
        path.write_text(TEXTS[path.suffix][how])
    elif path.suffix == ".json":
        path.write_text(json.dumps(_other_object(json.loads(whole), how)))
    elif path.suffix == ".npz":
        _other_arrays(path, how)
    elif path.suffix == ".csv":
        path.write_text(_other_table(whole.decode(), how))
    else:
        raise AssertionError(how)


def repair(folder: Path, whole: Path) -> None:
    """Make a folder what it was, out of its copy."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(whole, folder)


def _other_object(value: dict, how: str) -> dict:
    if how == "without half of its keys":
        return dict(list(value.items())[::2])
    return {key: str(entry) if isinstance(entry, int | float) else entry for key, entry in value.items()}


def _other_arrays(path: Path, how: str) -> None:
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    last = list(arrays)[-1]
    numbers = next(name for name, array in arrays.items() if array.dtype == float and array.ndim)
    if how == "without an array":
        del arrays[last]
    elif how == "words for an array":
        arrays[numbers] = np.full(arrays[numbers].shape, "word")
    elif how == "one row less":
        arrays[numbers] = arrays[numbers][:-1]
    elif how == "one axis more":
        arrays[numbers] = arrays[numbers][None]
    else:  # all of the same shape, and none that makes sense
        arrays = {name: array[..., :1] if array.ndim > 1 else array for name, array in arrays.items()}
    np.savez_compressed(path, **arrays)


def _other_table(text: str, how: str) -> str:
    rows = list(csv.reader(io.StringIO(text)))
    if how == "without a column":
        rows = [row[:-1] for row in rows]
    elif how == "without its last row":
        rows = rows[:-1]
    else:
        rows = [rows[0], *(["word" for _ in row] for row in rows[1:])] if rows else rows
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()
