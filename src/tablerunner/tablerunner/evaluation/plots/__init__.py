"""Pictures by matplotlib, without a screen."""

from tablerunner.evaluation.plots.trip import draw_trip

__all__ = ['draw_trip']
