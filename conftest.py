"""Make the node packages known to pytest before it looks at their tests, and share the tests out.

pytest gives a test the module name of its path, ``sim_bridge.test.test_node``, and would make an
empty package ``sim_bridge`` of the folder at the root that hides the real one inside it, unless
that has been imported already.

With workers (``pytest -n 3``) the first one runs the core's tests, which compute, while the others
begin with those over DDS, which mostly wait. It gives way to them: nodes must find time to run.
"""

from __future__ import annotations

import contextlib
import importlib
import os
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

for package in (
    'ceiling_camera',
    'fusion_node',
    'nav_controller',
    'odom_node',
    'sim_bridge',
    'uwb_driver',
):
    # The core is tested where there are no nodes, too.
    with contextlib.suppress(ImportError):
        importlib.import_module(package)

# Deadlines would measure how busy the machine is.
settings.register_profile(
    'tablerunner', deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile('tablerunner')

COMPUTING = 'gw0'
"""The worker for the core."""

COMPUTING_NICENESS = 3

CORE = 'src/tablerunner/test/'
FIRST = (
    # Its participants are in the process of the test: where many had been before, they were seen
    # to hear neither each other nor the domain they were in.
    'src/tablerunner_bringup/test/test_doctor.py',
    'test/bringup/',
    'test/bags/',
    'nav_controller/test/',
    'src/tablerunner_bringup/test/',
)
"""What takes longest, and would keep one worker busy after the others if it came late."""

ONE_BY_ONE = ('test/bringup/',)
"""Long tests that share nothing; of all other modules one worker runs the whole."""

TOGETHER = ('test/bags/test_simulated_run.py', 'test/bags/test_cut_bag.py')
"""Modules that share a recording, which one worker makes for both."""


def share_of(test: str) -> str:
    """Return the name of what is run by one worker together with a test."""
    path = test.partition('::')[0]
    if path.startswith(ONE_BY_ONE):
        return test
    return TOGETHER[0] if path in TOGETHER else path


def turn_of(share: str, computes: bool) -> int:
    """Return the place of a share in the order of a worker."""
    if share.startswith(CORE):
        return -1 if computes else len(FIRST) + 1
    return next((n for n, path in enumerate(FIRST) if share.startswith(path)), len(FIRST))


def pytest_configure(config: pytest.Config) -> None:
    """Let the core's worker give way."""
    worker = getattr(config, 'workerinput', None)
    if worker and worker['workerid'] == COMPUTING and worker['workercount'] > 1:
        os.nice(COMPUTING_NICENESS)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object:
    """Return what shares the tests out among the workers."""
    from xdist.scheduler import LoadScopeScheduling  # pytest runs without it, too

    class Sharing(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return share_of(nodeid)

        def _assign_work_unit(self, node: Any) -> None:
            computes = node.gateway.id == COMPUTING
            share = min(self.workqueue, key=lambda item: turn_of(item, computes))
            self.workqueue.move_to_end(share, last=False)
            super()._assign_work_unit(node)

        def _reschedule(self, node: Any) -> None:
            # What gives way starts no nodes, unless nobody else does.
            only_nodes = not any(item.startswith(CORE) for item in self.workqueue)
            if node.gateway.id == COMPUTING and len(self.nodes) > 1 and only_nodes:
                if not node.shutting_down:
                    node.shutdown()
                return
            super()._reschedule(node)

    config.option.loadscopereorder = False  # equals come in the order of collection
    return Sharing(config, log)
