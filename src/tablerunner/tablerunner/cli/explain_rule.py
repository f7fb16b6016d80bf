"""`tablerunner explain-rule`: why a fuzzy rule base decides as it does."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Optional

import typer

if TYPE_CHECKING:
    from tablerunner.control.fuzzy import RuleBase, Trace


def explain_rule(
    base: Annotated[
        str,
        typer.Option(
            metavar='NAME|FILE', help='A rule base of ours, or your own YAML; none: list ours.'
        ),
    ] = '',
    values: Annotated[
        Optional[list[str]],
        typer.Option('--set', metavar='NAME=VALUE', help='An input; give each one.'),
    ] = None,
    json_file: Annotated[
        Optional[Path],
        typer.Option('--json', metavar='FILE', help='Write the decision to a file.'),
    ] = None,
    plot_file: Annotated[
        Optional[Path],
        typer.Option('--plot', metavar='FILE', help='Draw the sets and the surface as a PNG.'),
    ] = None,
    over: Annotated[
        str,
        typer.Option(
            metavar='NAME,NAME', help='Inputs that the surface spans; the last two if not given.'
        ),
    ] = '',
) -> None:
    """Show which rules fire for given inputs, how strongly, and what comes out.

    Without --set it shows what the rule base takes and gives; the surface then holds the other
    inputs at the middle of their domains.

    Example: tablerunner explain-rule --base sun_track --set deviation=0.1 --set heading_error=-5
    """
    from tablerunner.cli.json_file import write_json
    from tablerunner.control.fuzzy import base_names, load_base

    if not base:
        for name in base_names():
            typer.echo(f'{name:<12} {load_base(name).title}')
        return
    rules = load_base(base)
    spanned = spanned_inputs(rules, over)
    trace = rules.trace(parse_values(values)) if values else None
    for line in describe(rules) if trace is None else report(trace):
        typer.echo(line)
    if json_file is not None:
        write_json(json_file, description(rules) if trace is None else trace.as_json())
    if plot_file is not None:
        from tablerunner.evaluation.plots.rule_base import draw_rule_base
        from tablerunner.evaluation.plots.sheet import write_sheet

        held = {item.name: 0.5 * (item.low + item.high) for item in rules.inputs}
        if trace is not None:
            held = {item.name: item.given for item in trace.inputs}
        marked = trace is not None
        write_sheet(
            lambda figure: draw_rule_base(figure, rules, spanned, held, marked),
            plot_file,
            (10.0, 4.8),
        )
        typer.echo(f'picture  {plot_file}')


def parse_values(given: list[str]) -> 'dict[str, float]':
    """Return the inputs of ``--set``.

    Raises
    ------
    ConfigError
        One is not NAME=NUMBER, or a name is given twice.
    """
    from tablerunner.errors import ConfigError

    found: dict[str, float] = {}
    for text in given:
        name, equals, number = text.partition('=')
        name = name.strip()
        try:
            value = float(number)
        except ValueError:
            equals = ''
        if not equals or not name:
            raise ConfigError('--set', text, 'NAME=VALUE with a number')
        if name in found:
            raise ConfigError('--set', text, f'each input once: {name} is {found[name]:g} already')
        found[name] = value
    return found


def spanned_inputs(base: 'RuleBase', over: str) -> 'tuple[str, str]':
    """Return the two inputs of ``--over``, or the last two.

    Raises
    ------
    ConfigError
        They are not two different inputs.
    """
    from tablerunner.errors import ConfigError

    names = base.input_names
    if not over:
        return names[-2 if len(names) > 1 else -1], names[-1]
    chosen = tuple(item.strip() for item in over.split(','))
    if len(chosen) != 2 or not set(chosen) <= set(names) or chosen[0] == chosen[1]:
        raise ConfigError('--over', over, 'two of the inputs, NAME,NAME: ' + ', '.join(names))
    return chosen[0], chosen[1]


def report(trace: 'Trace') -> list[str]:
    """Return the lines of a decision for people."""
    width = max(len(item.name) for item in trace.inputs)
    lines = [f'base     {trace.base}']
    for item in trace.inputs:
        degrees = '  '.join(f'{word} {degree:.3f}' for word, degree in item.degrees if degree > 0)
        value = f'{item.given:g} {item.unit}'.rstrip()
        if item.used != item.given:
            value += f', counts as {item.used:g}'
        lines.append(f'input    {item.name:<{width}} = {value}: {degrees}')
    for rule in trace.fired:
        when = ', '.join(f'{name} {word}' for name, word in rule.when)
        lines.append(
            f'fired    {rule.strength:.3f}  {100 * rule.share:4.1f} %  {rule.rule}: '
            f'{when} -> {rule.then} ({rule.centre:g})'
        )
    lines.append(f'output   {trace.name} = {trace.output:.4f} {trace.unit}'.rstrip())
    return lines


def describe(base: 'RuleBase') -> list[str]:
    """Return the lines about a rule base for people."""
    lines = [f'base     {base.name}: {base.title}', f'source   {base.source}']
    for kind, variables in (('input', base.inputs), ('output', (base.output,))):
        for item in variables:
            domain = f'{item.low:g} to {item.high:g} {item.unit}'.rstrip()
            words = ', '.join(item.words)
            lines.append(f'{kind:<8} {item.name}, {domain}: {words}; {item.description}')
    lines.append(
        f'rules    {len(base.rules)}, joined by {base.conjunction}, '
        f'output by {base.defuzzification.replace("_", " ")}'
    )
    return lines


def description(base: 'RuleBase') -> 'dict[str, object]':
    """Return what ``--json`` writes about a rule base without inputs."""
    return {
        'base': base.name,
        'title': base.title,
        'source': base.source,
        'inputs': {
            item.name: {'domain': [item.low, item.high], 'unit': item.unit, 'sets': item.words}
            for item in base.inputs
        },
        'output': {
            'name': base.output.name,
            'domain': [base.output.low, base.output.high],
            'unit': base.output.unit,
            'sets': base.output.words,
        },
        'rules': [
            {
                'rule': rule.name,
                'when': {base.inputs[i].name: base.inputs[i].sets[k].name for i, k in rule.when},
                'then': base.output.sets[rule.then].name,
            }
            for rule in base.rules
        ],
    }
