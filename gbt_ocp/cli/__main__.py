"""``python -m gbt_ocp.cli`` is ``gbt-ocp``."""

import sys
from pathlib import Path

# Python puts the current folder first on the path for -m, and a numpy.py there would be executed. It stays where it
# holds this package.
if not sys.flags.safe_path and Path(sys.path[0]).resolve() != Path(__file__).resolve().parents[2]:
    del sys.path[0]

from gbt_ocp.cli.program import main

raise SystemExit(main())
