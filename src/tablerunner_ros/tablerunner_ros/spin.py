"""The main of every node: start, spin, end cleanly, and say in one line what is wrong."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator

import rclpy
from rclpy.duration import Duration
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from tablerunner.errors import TablerunnerError
from tablerunner_ros.executor import make_executor
from tablerunner_ros.parameters import warn_undeclared

DONE, FAILED, BAD_INPUT = 0, 1, 2
"""Exit codes: ended as asked; died of an error; a parameter or argument cannot be used."""

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def spin_node(factory: Callable[[], Node], args: list[str] | None = None) -> int:
    """Run a node until SIGINT or SIGTERM, or until its context is shut down.

    The signals are not left to rclpy: its handlers shut the context down under the node's feet,
    from another thread, so that a callback that is running fails and nothing can be published any
    more. Here the callback that is running is finished; then a node with a method ``on_end`` gets
    it called, while it can still publish (a last zero velocity); then all is taken down. A second
    signal ends the process at once.

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
        rclpy.init(
            args=sys.argv if args is None else args,
            signal_handler_options=SignalHandlerOptions.NO,
        )
    except RuntimeError as error:  # RCLError, UnknownROSArgsError: a broken file, a wrong option
        return _bad_input(f'command line or parameter file: {_one_line(error)}')
    set_logger_level('rcl', LoggingSeverity.UNSET)
    executor = make_executor()
    node = None
    try:
        with _until_signalled(executor) as signalled:
            node = factory()
            warn_undeclared(node)
            executor.add_node(node)
            # What lives now lives as long as the process: the collector need not walk it again.
            gc.collect()
            gc.freeze()
            while rclpy.ok() and not signalled.is_set():
                executor.spin_once()
            if rclpy.ok() and hasattr(node, 'on_end'):
                node.on_end()
                _flush(node)
    except ExternalShutdownException:
        return DONE
    except (TablerunnerError, ParameterException) as error:
        return _bad_input(_one_line(error)) if node is None else _failed()
    except Exception:  # noqa: BLE001 (the last frame of the process: shown in full)
        return _failed()
    finally:
        executor.shutdown(0.0)
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return DONE


@contextlib.contextmanager
def _until_signalled(executor: Executor) -> Iterator[threading.Event]:
    """Set an event and wake the executor at the first signal.

    Python runs its signal handlers between two bytecodes of the main thread, which for a node
    that waits in DDS would be at the next message. The byte that the interpreter writes at once
    wakes a thread, and that wakes the executor.
    """
    signalled = threading.Event()
    before = {number: signal.getsignal(number) for number in SIGNALS}

    def handle(number: int, frame: object) -> None:  # noqa: ARG001 (as signal calls it)
        signalled.set()
        # Whoever asks twice does not want to wait for a clean end.
        for each in SIGNALS:
            signal.signal(each, signal.SIG_DFL)

    receiver, sender = os.pipe()
    os.set_blocking(sender, False)

    def watch() -> None:
        if os.read(receiver, 1) != _GOODBYE:
            # rclpy's executor goes on waiting when it is merely woken; work makes it return.
            executor.create_task(_nothing)

    watcher = threading.Thread(target=watch, name='signals', daemon=True)
    watcher.start()
    previous = signal.set_wakeup_fd(sender)
    for number in SIGNALS:
        signal.signal(number, handle)
    try:
        yield signalled
    finally:
        signal.set_wakeup_fd(previous)
        if not signalled.is_set():
            for number, handler in before.items():
                signal.signal(number, handler)
        os.write(sender, _GOODBYE)
        watcher.join()
        os.close(sender)
        os.close(receiver)


def _nothing() -> None:
    """Do nothing, in the executor's thread."""


_GOODBYE = b'\0'  # no signal has this number
_FLUSH_S = 0.3  # of the second that a robot may take to stand


def _flush(node: Node) -> None:
    """Give what was published last a moment to arrive: it goes with its publisher."""
    end = time.monotonic() + _FLUSH_S
    for publisher in node.publishers:
        left_s = max(end - time.monotonic(), 0.0)
        publisher.wait_for_all_acked(Duration(seconds=left_s))


def _bad_input(words: str) -> int:
    print(words, file=sys.stderr, flush=True)
    return BAD_INPUT


def _failed() -> int:
    traceback.print_exc()
    return FAILED


def _one_line(error: BaseException) -> str:
    return ' '.join(str(error).split())
