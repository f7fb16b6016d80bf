"""Any figure of ours in the house's style, as a PNG file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from tablerunner.errors import ConfigError
from tablerunner.evaluation.plots import style


def write_sheet(
    draw: Callable[[Any], None], file: Path, size_in: tuple[float, float] = (9.0, 4.5)
) -> None:
    """Write what a function draws into a PNG file.

    Parameters
    ----------
    draw : callable
        Takes an empty `matplotlib.figure.Figure`.
    file : Path
        Its folder is made if need be.
    size_in : tuple
        Width and height [inch], at 110 pixels per inch.

    Raises
    ------
    ConfigError
        The file cannot be written.
    """
    import matplotlib as mpl

    mpl.use('Agg')
    from matplotlib import pyplot as plt

    with mpl.rc_context(style.RC):
        figure = plt.figure(figsize=size_in, layout='constrained')
        try:
            draw(figure)
            file.parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(file, dpi=110, metadata={'Software': 'Tablerunner'})
        except OSError as error:
            raise ConfigError('', str(file), f'a file to write ({error.strerror})') from error
        finally:
            plt.close(figure)
