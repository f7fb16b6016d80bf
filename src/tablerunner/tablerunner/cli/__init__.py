"""The `tablerunner` command: what works without ROS, and what other packages add to it."""
