"""Fixtures for tests over DDS."""

from tablerunner_ros.testing.fixtures import domain, probe, processes

__all__ = ['domain', 'probe', 'processes']
