"""The planner as a folder of C."""
