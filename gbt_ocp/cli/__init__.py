"""The command line `gbt-ocp`."""
