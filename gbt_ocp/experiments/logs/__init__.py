"""Logs of others: CSV, ROS bags, MCAP, MAVLink and IMC, by a mapping of their messages (docs/howto/logs.md)."""
