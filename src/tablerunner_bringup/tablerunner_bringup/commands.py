"""The commands that need ROS; the core's `tablerunner` command finds them by entry points."""

import datetime as dt
from pathlib import Path
from typing import Annotated, Optional

import typer

from tablerunner.cli.console import Progress
from tablerunner.cli.exits import FAILED
from tablerunner_bringup.run_options import RunOptions

_Scenario = Annotated[
    Optional[Path],
    typer.Option('--scenario', help='Scenario file; the restaurant when not given.'),
]
_Seed = Annotated[int, typer.Option(min=0, help='Seed of everything that is drawn.')]
_Factor = Annotated[
    float, typer.Option('--real-time-factor', min=0.01, max=20.0, help='Simulated s per s.')
]
_Domain = Annotated[
    Optional[int], typer.Option(help='ROS domain; a simulated run takes a free one of its own.')
]
_Estimator = Annotated[str, typer.Option(help='Estimator of fusion_node.')]
_UnknownStart = Annotated[
    bool, typer.Option('--unknown-start', help='Do not tell the robot where it stands.')
]


def launch(
    scenario: _Scenario = None,
    seed: _Seed = 1,
    namespace: Annotated[str, typer.Option(help='Namespace of all nodes.')] = '',
    stops: Annotated[
        Optional[list[str]],
        typer.Option('--deliver', help='Table to go to, then end; may be given often.'),
    ] = None,
    wait: Annotated[float, typer.Option(min=0.0, help='Seconds to stand at each table.')] = 3.0,
    return_home: Annotated[
        bool, typer.Option('--return-home/--stay', help='Whether to come home afterwards.')
    ] = True,
    record_bag: Annotated[bool, typer.Option('--record', help='Record all topics.')] = False,
    record_topics: Annotated[
        Optional[list[str]], typer.Option('--topics', help='Record only these; * and ? allowed.')
    ] = None,
    sim: Annotated[
        bool, typer.Option('--sim/--no-sim', help='Simulate, or drive a real robot.')
    ] = True,
    localization_only: Annotated[
        bool,
        typer.Option('--localization-only', help='Somebody else drives (Nav2): pose and TF only.'),
    ] = False,
    odom_topic: Annotated[
        str, typer.Option(help='Odometry of somebody else in the place of odom_node.')
    ] = '',
    robot_description: Annotated[
        bool,
        typer.Option('--robot-description', help='robot_state_publisher tells of the sensors.'),
    ] = False,
    unknown_start: _UnknownStart = False,
    estimator: _Estimator = 'ekf',
    real_time_factor: _Factor = 1.0,
    params: Annotated[
        Optional[list[Path]],
        typer.Option(exists=True, help='ROS parameter file over all others; may be repeated.'),
    ] = None,
    remap: Annotated[
        Optional[list[str]],
        typer.Option('--remap', help='OLD:=NEW name of a topic, in every node; may be repeated.'),
    ] = None,
    domain: _Domain = None,
    output: Annotated[
        Optional[Path],
        typer.Option('-o', '--output', help='Folder of the run; out/runs/... else.'),
    ] = None,
) -> None:
    """Start the whole robot, each node a process of its own, until Ctrl-C or the deliveries' end.

    Example: tablerunner launch --deliver table_3 --deliver table_7 --record
    """
    from tablerunner_bringup.launching import LaunchOptions
    from tablerunner_bringup.launching import launch as run
    from tablerunner_bringup.session import SessionSettings

    run_options = _run_options(
        scenario, seed, unknown_start, estimator, real_time_factor, namespace, sim
    ).replace(
        localization_only=localization_only,
        odom_topic=odom_topic,
        robot_description=robot_description,
    )
    if localization_only and stops:
        raise typer.BadParameter('nobody drives then', param_hint='--deliver')
    options = LaunchOptions(
        run_options,
        SessionSettings(
            record=record_bag or bool(record_topics),
            record_topics=tuple(map(_absolute, record_topics or ())),
            domain=domain,
            parameter_files=tuple(params or ()),
            remap=tuple(map(_rule, remap or ())),
        ),
        tuple(stops or ()),
        wait,
        return_home,
        output,
    )
    code = run(options, Progress())
    raise typer.Exit(code)


def demo(
    scenario: _Scenario = None,
    seed: _Seed = 1,
    tables: Annotated[
        Optional[list[str]],
        typer.Option(
            '--table', help='Where a meal goes; may be given often. Default: table_5, table_6.'
        ),
    ] = None,
    time_limit: Annotated[
        float, typer.Option(min=1.0, help='Simulated seconds within which it must be done.')
    ] = 300.0,
    unknown_start: _UnknownStart = False,
    estimator: _Estimator = 'ekf',
    real_time_factor: _Factor = 1.0,
    domain: _Domain = None,
    output: Annotated[
        Path, typer.Option('-o', '--output', help='Folder for the results; those of before go.')
    ] = Path('out') / 'demo',
) -> None:
    """Deliver meals in a simulated restaurant where things are in the way, and judge the trip.

    In the evening scenario an aisle is blocked by crates that the map does not know and a guest
    stands in the other; on the way to the last table the robot is stopped by an emergency stop
    and released. What is shown is judged by the truth and told.

    Writes bag/, trip.png and errors.json. Example: tablerunner demo --table table_7 --seed 5
    """
    from tablerunner_bringup.demo import DemoOptions
    from tablerunner_bringup.demo import demo as run

    options = DemoOptions(
        _run_options(scenario, seed, unknown_start, estimator, real_time_factor),
        tuple(tables or ()),
        limit_s=time_limit,
        output=output,
        domain=domain,
    )
    code = run(options, Progress())
    raise typer.Exit(code)


def _run_options(
    scenario: Path | None,
    seed: int,
    unknown_start: bool,
    estimator: str,
    real_time_factor: float,
    namespace: str = '',
    simulated: bool = True,
) -> RunOptions:
    return RunOptions(
        scenario='' if scenario is None else str(scenario),
        seed=seed,
        namespace=namespace.strip('/'),
        simulated=simulated,
        unknown_start=unknown_start,
        real_time_factor=real_time_factor,
        estimator=estimator,
    )


def record(
    output: Annotated[
        Optional[Path], typer.Option('-o', '--output', help='Folder of the bag; must not exist.')
    ] = None,
    storage: Annotated[
        str, typer.Option('--format', help='mcap or sqlite3.', metavar='FORMAT')
    ] = 'mcap',
    topics: Annotated[
        Optional[list[str]],
        typer.Option('--topics', help='Topic to record; * and ? allowed; may be given often.'),
    ] = None,
    everything: Annotated[
        bool, typer.Option('--all', help='Hidden topics too (those of actions).')
    ] = False,
    use_sim_time: Annotated[
        bool, typer.Option('--use-sim-time', help='Stamp with /clock instead of system time.')
    ] = False,
    duration: Annotated[
        float, typer.Option(min=0.0, help='End after so many seconds; 0: never.')
    ] = 0.0,
    domain: Annotated[
        Optional[int], typer.Option(help='ROS domain; that of ROS_DOMAIN_ID when not given.')
    ] = None,
) -> None:
    """Record topics into a bag, with all message definitions, until Ctrl-C.

    Example: tablerunner record -o out/kitchen --topics '/uwb/*' --topics /odom
    """
    from tablerunner_bringup.recorder import Selection
    from tablerunner_bringup.recording import RecordOptions
    from tablerunner_bringup.recording import record as run

    stamp = dt.datetime.now().astimezone().strftime('%Y-%m-%d_%H-%M-%S')
    options = RecordOptions(
        output or Path('out') / f'bag_{stamp}',
        storage,
        Selection(tuple(map(_absolute, topics or ())), everything),
        use_sim_time,
        duration or float('inf'),
        domain,
    )
    progress = Progress()
    written, losses = run(options, progress)
    for topic, count in sorted(losses.missed.items()):
        progress.say(f'{topic}: {count} messages did not arrive here', 'yellow')
    for topic, reason in sorted(losses.refused.items()):
        progress.say(f'{topic} was not recorded: {reason}', 'yellow')
    if losses.unstamped:
        progress.say(f'{losses.unstamped} messages came without a /clock: left out', 'yellow')
    typer.echo(f'{written} messages in {options.folder}')
    if not written:
        raise typer.Exit(FAILED)


def play(
    bag: Annotated[Path, typer.Argument(help='Folder of the bag, an .mcap or a .db3 file.')],
    rate: Annotated[float, typer.Option(help='Seconds of the bag per second.')] = 1.0,
    start: Annotated[float, typer.Option(min=0.0, help='Begin at this second.')] = 0.0,
    topics: Annotated[
        Optional[list[str]],
        typer.Option('--topics', help='Topic to play; * and ? allowed; may be given often.'),
    ] = None,
    remap: Annotated[
        Optional[list[str]], typer.Option('--remap', help='OLD:=NEW name of a topic.')
    ] = None,
    clock: Annotated[
        bool, typer.Option('--clock/--no-clock', help='Publish /clock by the times of the bag.')
    ] = True,
    loop: Annotated[bool, typer.Option('--loop', help='Begin again at the end.')] = False,
    wait_for: Annotated[
        Optional[list[str]],
        typer.Option('--wait-for', help='Topic that must have a subscriber before the start.'),
    ] = None,
    wait_limit: Annotated[
        float, typer.Option(min=0.0, help='Seconds to wait for them before giving up.')
    ] = 30.0,
    domain: Annotated[
        Optional[int], typer.Option(help='ROS domain; that of ROS_DOMAIN_ID when not given.')
    ] = None,
) -> None:
    """Publish a bag with its own quality of service, in its order and at its pace.

    Example: tablerunner play out/demo/bag --topics '/uwb/*' --rate 2 --wait-for /uwb/ranges
    """
    from tablerunner_bringup.player import Pace
    from tablerunner_bringup.playing import PlayOptions
    from tablerunner_bringup.playing import play as run
    from tablerunner_bringup.recorder import Selection

    if not rate > 0.0:
        raise typer.BadParameter('expected a rate above 0', param_hint='--rate')
    options = PlayOptions(
        bag,
        Pace(rate, start, clock, dict(map(_renaming, remap or ()))),
        Selection(tuple(map(_absolute, topics or ())), hidden=True),
        tuple(map(_absolute, wait_for or ())),
        wait_limit,
        loop,
        domain,
    )
    count = run(options, Progress())
    typer.echo(f'{count} messages of {bag}')


def _absolute(topic: str) -> str:
    return topic if topic.startswith('/') else f'/{topic}'


def _rule(text: str) -> str:
    old, found, new = text.partition(':=')
    if not (old and found and new):
        raise typer.BadParameter(f'{text!r}: expected OLD:=NEW', param_hint='--remap')
    return text


def _renaming(text: str) -> tuple[str, str]:
    old, _, new = _rule(text).partition(':=')
    return _absolute(old), _absolute(new)
