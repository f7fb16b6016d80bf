"""Set-up of the workspace: virtual environment, ROS 2 wheels and colcon build.

Standard library only, because it runs before anything is installed.
"""
