"""Tablerunner's core library: ranging, odometry, estimation, control and simulation without ROS."""

__version__ = '0.1.0'
