"""Fixtures of this package's tests."""

from tablerunner_ros.testing.fixtures import domain, probe, processes

__all__ = ['domain', 'probe', 'processes']
