"""Names of a generated folder: a prefix for two planners in one program, and what the linker tells them apart by."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping

_PREFIX = re.compile(r"[a-z][a-z0-9_]{0,31}")


def checked_prefix(prefix: str) -> str:
    """The prefix, if names of C may begin with it.

    Raises
    ------
    ValueError
        If it is neither empty nor a lower-case letter followed by at most 31 lower-case letters, digits and
        underscores.
    """
    if prefix and not _PREFIX.fullmatch(prefix):
        raise ValueError(
            f"prefix: found {prefix!r}; allowed: a lower-case letter, then at most 31 lower-case letters, digits and "
            "underscores, such as bow_"
        )
    return prefix


def prefixed(text: str, prefix: str) -> str:
    """A text with the prefix before every name of the planner: ``gbt_plan`` is ``bow_gbt_plan`` for ``bow_``.

    Macros and constants take it in capitals (``BOW_GBT_PIECES``). Names of files count as names, the name of this
    package does not.
    """
    text = re.sub(r"\bgbt_(?!ocp\b)", f"{prefix}gbt_", text)
    return re.sub(r"(?:\b|(?<=-D))GBT_", f"{prefix.upper()}GBT_", text)


def identity_header(sources: Mapping[str, str]) -> str:
    """``gbt_identity.h`` of these sources (name to content): equal for equal sources only."""
    content = "\0".join(f"{name}\0{text}" for name, text in sorted(sources.items()))
    return _IDENTITY.format(hashlib.sha256(content.encode()).hexdigest()[:12])


_IDENTITY = """/* Generated: what distinguishes this planner from others. It has no include guard and is read before
   those of other headers, so that headers of a second planner are not taken for those of the first. */
#ifndef GBT_IDENTITY
#define GBT_IDENTITY _{0}
#define GBT_IDENTITY_NUMBER 0x{0}
#elif GBT_IDENTITY_NUMBER != 0x{0}
#error "found headers of two generated planners with the same names; allowed: a prefix each (gbt-ocp codegen --prefix)"
#endif
"""
