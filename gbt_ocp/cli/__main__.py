"""``python -m gbt_ocp.cli`` is ``gbt-ocp``."""

from gbt_ocp.cli.program import main

raise SystemExit(main())
