"""Node: the simulated robot and room on the ROS side."""
