"""The rows of benchmarks/sea_water.py: every configuration that they run is one that is accepted."""

import json
from pathlib import Path

import pytest

from gbt_ocp.experiments.config.loading import load_config


@pytest.fixture
def sea_water(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[1] / "benchmarks"))
    import sea_water

    return sea_water


def test_configurations_of_all_rows_are_accepted(sea_water):
    seen = set()
    for pair in (pair for pairs in sea_water.PAIRS.values() for pair in pairs):
        for beside in (True, False):
            keys = sea_water.overrides(pair, 0, 120.0, beside=beside)
            lines = [f"{key}={json.dumps(value)}" for key, value in keys.items()]
            if (pair.configuration, *lines) not in seen:
                load_config(pair.configuration, overrides=lines, seed=0)
                seen.add((pair.configuration, *lines))
    assert len(seen) > 15
