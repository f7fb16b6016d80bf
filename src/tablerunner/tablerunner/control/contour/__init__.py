"""Contour following: out of traps along the edge of what is in the way (Lv 4.C)."""

from tablerunner.control.contour.config import ContourConfig
from tablerunner.control.contour.navigator import ContourNavigator, Mode, NavigatorStep

__all__ = ['ContourConfig', 'ContourNavigator', 'Mode', 'NavigatorStep']
