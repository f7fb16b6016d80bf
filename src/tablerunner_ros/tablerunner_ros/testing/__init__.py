"""Tools for tests over DDS: domains of one's own, processes that end, waits with a limit.

For tests only; nothing here is imported by a node. A test module takes the fixtures by

    from tablerunner_ros.testing.fixtures import domain, probe, processes  # noqa: F401
"""
