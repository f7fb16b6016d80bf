"""The main of every node: start, spin, end cleanly, and say in one line what is wrong."""

from __future__ import annotations

import gc
import sys
import traceback
from collections.abc import Callable

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node

from tablerunner.errors import TablerunnerError
from tablerunner_ros.parameters import warn_undeclared

DONE, FAILED, BAD_INPUT = 0, 1, 2
"""Exit codes: ended as asked; died of an error; a parameter or argument cannot be used."""


def spin_node(factory: Callable[[], Node], args: list[str] | None = None) -> int:
    """Run a node until SIGINT or SIGTERM, or until its context is shut down.

    Parameters
    ----------
    factory : callable
        Makes the node, once rclpy has been initialised: mostly the node's class.
    args : list of str or None
        Command line; None takes the process's own.

    Returns
    -------
    int
        0 after a clean end, 2 when a parameter or argument cannot be used (one line on stderr
        says which), 1 when anything else was raised (with its traceback).
    """
    # rcl logs a second, longer version of what is said below.
    set_logger_level('rcl', LoggingSeverity.FATAL)
    try:
        rclpy.init(args=sys.argv if args is None else args)
    except RuntimeError as error:  # RCLError, UnknownROSArgsError: a broken file, a wrong option
        return _bad_input(f'command line or parameter file: {_first_line(error)}')
    set_logger_level('rcl', LoggingSeverity.UNSET)
    node = None
    try:
        node = factory()
        warn_undeclared(node)
        _spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        return DONE
    except (TablerunnerError, ParameterException) as error:
        return _bad_input(_first_line(error)) if node is None else _failed()
    except Exception:  # noqa: BLE001 (the last frame of the process: shown in full)
        return _failed()
    finally:
        _end(node)
    return DONE


def _spin(node: Node) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    # What lives now lives as long as the process: the collector need not walk it at 250 Hz.
    gc.collect()
    gc.freeze()
    try:
        executor.spin()
    finally:
        executor.remove_node(node)


def _end(node: Node | None) -> None:
    try:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    except KeyboardInterrupt:
        pass  # a second Ctrl-C while ending changes nothing


def _bad_input(words: str) -> int:
    print(words, file=sys.stderr, flush=True)
    return BAD_INPUT


def _failed() -> int:
    traceback.print_exc()
    return FAILED


def _first_line(error: BaseException) -> str:
    return ' '.join(str(error).split())
