"""`tablerunner info`: what a bag holds, and what of it is damaged."""

from pathlib import Path
from typing import Annotated, Optional

import typer


def info(
    bag: Annotated[
        Path, typer.Argument(metavar='BAG', help='Bag folder, an .mcap or a .db3 file.')
    ],
    deep: Annotated[
        bool, typer.Option('--deep', help='Also decode every message, to find damaged ones.')
    ] = False,
    json_file: Annotated[
        Optional[Path], typer.Option('--json', metavar='FILE', help='Write it to a file too.')
    ] = None,
) -> None:
    """Show what a bag holds, and what of it cannot be read.

    Example: tablerunner info out/demo/bag
    """
    from tablerunner.bags.reader import BagReader
    from tablerunner.cli.json_file import write_json
    from tablerunner.types import seconds

    with BagReader(bag) as reader:
        if deep:
            for _ in reader.messages():
                pass
        span = seconds(reader.end - reader.start)
        typer.echo(f'{bag}: {span:.3f} s, {reader.message_count} messages')
        width = max((len(topic.name) for topic in reader.topics), default=0)
        for topic in reader.topics:
            typer.echo(f'  {topic.name:<{width}}  {topic.count:>8}  {topic.msgtype}')
        for item in reader.damage:
            typer.echo(f'damaged: {item}')
        if json_file is not None:
            content = {
                'bag': str(bag),
                'data_s': span,
                'messages': reader.message_count,
                'topics': {
                    topic.name: {'type': topic.msgtype, 'messages': topic.count}
                    for topic in reader.topics
                },
                'damage': [str(item) for item in reader.damage],
            }
            write_json(json_file, content)
