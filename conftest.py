"""Make the node packages known to pytest before it looks at their tests.

pytest gives a test the module name of its path, ``sim_bridge.test.test_node``, and would make an
empty package ``sim_bridge`` of the folder at the root that hides the real one inside it, unless
that has been imported already.
"""

import contextlib
import importlib

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
