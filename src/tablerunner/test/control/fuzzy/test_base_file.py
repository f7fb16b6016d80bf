"""Rule bases from files: those that come with the core, and everything that can be wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from tablerunner.config import Document
from tablerunner.control.fuzzy import base_names, base_path, load_base, read_base
from tablerunner.errors import ConfigError


def refusal(text: str, old: str, new: str) -> ConfigError:
    """Return the error after one change."""
    assert text.count(old) == 1, old
    changed = text.replace(old, new)
    with pytest.raises(ConfigError) as caught:
        read_base(Document.parse(changed, 'brake.yaml'), 'brake')
    error = caught.value
    assert error.source == 'brake.yaml'
    return error


def test_bases_of_the_core_are_read_by_name_and_by_path(tmp_path: Path) -> None:
    assert base_names() == ('lv_corner', 'lv_speed', 'sun_track')
    for name in base_names():
        base = load_base(name)
        assert base.name == name
        copy = tmp_path / 'mine.yaml'
        copy.write_text(base_path(name).read_text())
        mine = load_base(copy)
        assert (mine.name, mine.rules, mine.inputs) == ('mine', base.rules, base.inputs)


def test_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"got 'lv_korner', .*did you mean lv_corner"):
        load_base('lv_korner')
    with pytest.raises(ConfigError, match='lv_corner, lv_speed, sun_track'):
        load_base('nothing')
    with pytest.raises(ConfigError, match='a readable file'):
        load_base('no/such/file.yaml')


def test_rules_of_tables_and_lists_come_together(text: str) -> None:
    base = read_base(Document.parse(text), 'brake')
    assert [rule.name for rule in base.rules] == [
        'first, near/slow',
        'first, near/fast',
        'first, middle/slow',
        'first, middle/fast',
        'rule 1',
    ]
    assert base.rules[3].when == ((0, 1), (1, 1))
    assert base.rules[3].then == 1
    assert base.rules[4].when == ((0, 2),)


CELL = 'tables[0].cells.middle'


@pytest.mark.parametrize(
    ('old', 'new', 'at', 'field', 'words'),
    [
        # Gaps in a table.
        ('middle: [none, some]', 'middle: [none, ]', 'middle: [', CELL, '2 cells, for slow, fast'),
        (
            'middle: [none, some]',
            'middle: [none, null]',
            'middle: [',
            f'{CELL}[1]',
            "got 'nothing', expected a set of brake: a gap at speed fast",
        ),
        (
            '      middle: [none, some]\n',
            '',
            '  - name: first',
            'tables[0]',
            "got 'no rule', expected a rule for distance middle, speed slow (and 1 more)",
        ),
        (
            '  - when: {distance: far}',
            '  - when: {distance: far, speed: slow}',
            'name: first',
            'tables[0]',
            "got 'no rule', expected a rule for distance far, speed fast",
        ),
        # Contradictions and repetitions.
        (
            '  - when: {distance: far}\n    then: none',
            '  - when: {distance: far}\n    then: none\n'
            '  - when: {distance: far, speed: slow}\n    then: full',
            '  - when: {distance: far, speed',
            'rules[1]',
            "got 'full', expected no contradiction: none, as rule 1 in line 32 says",
        ),
        (
            '  - when: {distance: far}\n    then: none',
            '  - when: {distance: far}\n    then: none\n'
            '  - when: {speed: slow, distance: near}\n    then: some',
            '  - when: {speed',
            'rules[1]',
            'each rule once: first, near/slow in line 29 says the same',
        ),
        # Unknown names.
        (
            'middle: [none, some]',
            'middle: [none, sone]',
            'middle: [',
            f'{CELL}[1]',
            "got 'sone', expected a set of brake (did you mean some?)",
        ),
        (
            'middle: [none, some]',
            'center: [none, some]',
            'center',
            'tables[0].cells.center',
            'a row of distance: near, middle, far',
        ),
        ('order: [slow, fast]', 'order: [slow, quick]', 'order', 'tables[0].order[1]', 'a column'),
        ('order: [slow, fast]', 'order: [slow, slow]', 'order', 'tables[0].order[1]', 'once'),
        ('rows: distance', 'rows: distanse', 'rows', 'tables[0].rows', 'an input or situations'),
        (
            'when: {distance: far}',
            'when: {distances: far}',
            'when',
            'rules[0].when.distances',
            "got 'distances', expected an input (did you mean distance?)",
        ),
        (
            'when: {distance: far}',
            'when: {distance: remote}',
            'when',
            'rules[0].when.distance',
            'a set of distance: near, middle, far',
        ),
        ('then: none', 'then: never', 'then', 'rules[0].then', "got 'never', expected a set"),
        # Domains and sets.
        (
            'near: {left_shoulder: [1.0, 4.0]}',
            'near: {left_shoulder: [0.5, 1.0]}',
            'sets:',
            'inputs.distance.sets',
            'sets that cover the domain, 0 to 10 m: none holds 1',
        ),
        (
            'far: {right_shoulder: [4.0, 8.0]}',
            'far: {right_shoulder: [11.0, 12.0]}',
            'far: {',
            'inputs.distance.sets.far',
            'a set that is 1 somewhere within the domain, 0 to 10 m',
        ),
        (
            'slow: {gaussian: [0.0, 0.6]}',
            'slow: {gaussian: [0.0, 0.0]}',
            'slow: {',
            'inputs.speed.sets.slow.gaussian',
            'standard deviation from 1e-06',
        ),
        (
            'middle: {triangle: [1.0, 4.0, 8.0]}',
            'middle: {triangle: [1.0, 4.0, 4.0]}',
            'middle: {',
            'inputs.distance.sets.middle.triangle',
            'corners that go up',
        ),
        (
            'middle: {triangle: [1.0, 4.0, 8.0]}',
            'middle: {triangle: [1.0, .nan, 8.0]}',
            'middle: {',
            'inputs.distance.sets.middle.triangle[1]',
            'a finite number',
        ),
        (
            'middle: {triangle: [1.0, 4.0, 8.0]}',
            'middle: {triangle: [1.0, 4.0, 8.0], gaussian: [1.0, 1.0]}',
            'middle: {',
            'inputs.distance.sets.middle',
            "got 'triangle and gaussian', expected exactly one of triangle, trapezoid",
        ),
        (
            'domain: [0.0, 2.0]',
            'domain: [2.0, 0.0]',
            'domain: [2',
            'inputs.speed.domain',
            'the smaller value first',
        ),
        ('triangle: [1.0, 4.0, 8.0]', 'cone: [1.0]', 'middle: {', None, 'a known field'),
        (
            'domain: [0.0, 2.0]',
            'domain: [0.0, 1.0e+300]',
            'domain: [0.0, 1.0e',
            'inputs.speed.domain[1]',
            'at most 1e+06',
        ),
        (
            'middle: {triangle: [1.0, 4.0, 8.0]}',
            'middle: {triangle: [4.0, 4.0000001, 8.0]}',
            'middle: {',
            'inputs.distance.sets.middle.triangle',
            'sides at least 1e-06 wide',
        ),
        # Methods.
        (
            'title: how hard to brake',
            'conjunction: maximum',
            'conjunction',
            'conjunction',
            "got 'maximum', expected one of min, product",
        ),
    ],
)
def test_what_is_wrong_is_named_with_its_place(
    text: str, old: str, new: str, at: str, field: str | None, words: str
) -> None:
    error = refusal(text, old, new)
    assert words in str(error)
    if field is not None:
        assert error.field == field
    changed = text.replace(old, new)
    lines = [n for n, row in enumerate(changed.splitlines(), 1) if at in row]
    assert error.line in lines, str(error)


def test_input_without_rule_and_second_output_are_refused(text: str) -> None:
    more = '  weather:\n    domain: [0.0, 1.0]\n    sets: {any: {triangle: [-1.0, 0.5, 2.0]}}\n'
    error = refusal(text, 'output:\n', f'{more}output:\n')
    assert "weather: got 'weather', expected an input that a rule has a condition on" in str(error)
    error = refusal(text, 'tables:\n', f'{more}tables:\n')
    assert 'exactly one output' in str(error)


SITUATIONS = """\
inputs:
  a: {domain: [0, 1], sets: {no: {left_shoulder: [0, 1]}, yes: {right_shoulder: [0, 1]}}}
  b: {domain: [0, 1], sets: {no: {left_shoulder: [0, 1]}, yes: {right_shoulder: [0, 1]}}}
output:
  c: {domain: [0, 1], sets: {small: {left_shoulder: [0, 1]}, big: {right_shoulder: [0, 1]}}}
situations:
  both: {a: 'yes', b: 'yes'}
  one: {a: 'yes', b: 'no'}
  other: {a: 'no', b: 'yes'}
  neither: {a: 'no', b: 'no'}
tables:
  - name: t
    rows: a
    columns: situations
    order: [both, one, other, neither]
    cells:
      'yes': [big, big, small, small]
"""


def test_situations_stand_for_their_conditions_and_may_not_clash_with_the_row() -> None:
    with pytest.raises(ConfigError, match="'a no', expected one condition on a, not also yes"):
        read_base(Document.parse(SITUATIONS, 's.yaml'), 's')
    good = SITUATIONS.replace('rows: a', 'rows: b').replace(
        "'yes': [big, big, small, small]", "'yes': [big, small]"
    )
    good = good.replace('order: [both, one, other, neither]', 'order: [both, other]')
    good += (
        "  - {name: u, when: {b: 'no'}, rows: a, columns: b, order: ['no'],\n"
        "     cells: {'yes': [small], 'no': [small]}}\n"
    )
    base = read_base(Document.parse(good, 's.yaml'), 's')
    # Where a and b are 1 or 0 a single rule fires: 'big' only for both.
    for a in (0.0, 1.0):
        for b in (0.0, 1.0):
            assert base.infer_one(a, b) == a * b
    unknown = good.replace("both: {a: 'yes'", 'both: {a: maybe')
    with pytest.raises(ConfigError, match=r's.yaml:7: situations.both.a: got .maybe'):
        read_base(Document.parse(unknown, 's.yaml'), 's')


def test_base_that_nobody_can_check_is_refused() -> None:
    """Ten inputs of five sets have ten million combinations."""
    sets = ', '.join(f's{k}: {{triangle: [{k - 1}, {k}, {k + 1}]}}' for k in range(5))
    inputs = ''.join(f'  i{k}: {{domain: [0, 4], sets: {{{sets}}}}}\n' for k in range(10))
    text = (
        f'inputs:\n{inputs}output:\n  o: {{domain: [0, 4], sets: {{{sets}}}}}\n'
        'rules:\n  - {when: {i0: s0}, then: s0}\n'
    )
    with pytest.raises(ConfigError, match='got 9765625, expected at most 1000000 combinations'):
        read_base(Document.parse(text), 'big')
