"""The JSON schema of a configuration file, for editors."""

from __future__ import annotations

from typing import Any

from gbt_ocp.experiments.config.allowed import with_sizes
from gbt_ocp.experiments.config.schema import Configuration


def json_schema() -> dict[str, Any]:
    """JSON schema of a file as a user writes it: every key optional, no others allowed, each with meaning and units."""
    tree = Configuration.model_json_schema()
    tree["title"] = "gbt_ocp configuration"
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_as_written(tree)}


def _as_written(node: Any) -> Any:
    if isinstance(node, list):
        return [_as_written(item) for item in node]
    if not isinstance(node, dict):
        return node
    # What a problem or a preset fills in need not be written. Without a required kind several branches of a union
    # can hold at once, which oneOf would refuse.
    written = {
        {"oneOf": "anyOf"}.get(key, key): _as_written(value)
        for key, value in node.items()
        if key not in ("required", "discriminator", "allowed")
    }
    if isinstance(node.get("allowed"), str):
        written["description"] = f"{node['description']} Allowed: {with_sizes(node['allowed'], {})}."
    return written
