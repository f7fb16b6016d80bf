"""Solvers: from the ranges of an epoch to a position, one algorithm per module."""
