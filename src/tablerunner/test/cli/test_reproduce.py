"""The table of an experiment: nothing that decides is cut off."""

import io

from rich.console import Console

from tablerunner.cli.reproduce import table_of
from tablerunner.experiments.experiment import Bound, Outcome, Row, Spread

LONG = 'situation II, odometry aided by a gyroscope on a long square, largest error'


def printed(paper, width=90):
    row = Row(LONG, 'm', Spread.of([0.5, 0.6]), paper, bound=Bound(high=0.7))
    outcome = Outcome('x', 'An experiment', (0, 1), (row,), lambda figure: None)
    console = Console(file=io.StringIO(), width=width)
    console.print(table_of(outcome))
    return console.file.getvalue()


def test_long_name_takes_a_second_line_and_verdict_is_whole():
    text = printed(0.25)
    assert 'holds' in text
    assert '0.5 .. 0.6' in text
    assert '0.25' in text
    assert ' '.join(LONG.split()[-2:]) in ' '.join(text.split())


def test_experiment_without_paper_has_no_column_for_it():
    assert 'paper' in printed(0.25)
    assert 'paper' not in printed(None)
    assert '0.55 +-' in printed(None)
