"""Nodes: drive to waypoints and tables, and the safety stop before the wheels."""
