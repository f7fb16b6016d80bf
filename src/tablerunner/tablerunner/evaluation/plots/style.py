"""Colours and type of all pictures: one palette that colour-blind people can tell apart.

Okabe and Ito, "Color Universal Design", 2008; furniture and walls stay in the background.
"""

from __future__ import annotations

from typing import Any

TRUTH = '#000000'
ESTIMATE = '#0072B2'
FIX = '#E69F00'
NLOS = '#D55E00'
HALT = '#CC79A7'
EMERGENCY = '#F0E442'
ANCHOR = '#009E73'

WALL = '#4A4A4A'
TABLE_FACE, TABLE_EDGE = '#EFE7DB', '#B8A78D'
BOX_FACE, BOX_EDGE = '#DADDE0', '#9AA0A6'
TEXT = '#222222'
SUBDUED = '#6B6B6B'
GRID = '#E6E6E6'

RC: Any = {
    'font.family': 'DejaVu Sans',
    'font.size': 9.0,
    'text.color': TEXT,
    'axes.edgecolor': '#BBBBBB',
    'axes.labelcolor': TEXT,
    'axes.linewidth': 0.8,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'xtick.color': SUBDUED,
    'ytick.color': SUBDUED,
    'legend.frameon': False,
    'figure.facecolor': 'white',
    'savefig.facecolor': 'white',
}
"""Settings for `matplotlib.rc_context`."""
