"""Set the workspace up: `python3 tools/bootstrap`, which the Makefile calls before all else.

Keep this file readable by old Pythons: it is the one that tells their users so.
"""

import os
import sys

OLDEST = (3, 10)
NEWEST = (3, 14)


def main():
    """Check the Python that runs this, then hand over to the set-up."""
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        sys.stderr.write(
            'error: Python %d.%d is not supported: install CPython %d.%d to %d.%d and name it, '
            'for example `make PYTHON=python3.11 demo`.\n'
            % (tuple(sys.version_info[:2]) + OLDEST + NEWEST)
        )
        return 1
    # Run as a folder, Python puts that folder first on the path: replace it by its parent.
    sys.path[0] = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    from bootstrap import steps

    return steps.main(sys.argv[1:])


if __name__ == '__main__':
    sys.exit(main())
