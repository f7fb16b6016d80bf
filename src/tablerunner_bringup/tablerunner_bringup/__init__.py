"""Launcher, launch files, parameters, scenarios, bag recorder and player of Tablerunner."""
