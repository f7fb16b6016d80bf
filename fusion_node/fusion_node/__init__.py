"""Node: all measurements to the pose in the map and the transform map to odom."""
