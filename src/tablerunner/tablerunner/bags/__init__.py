"""rosbag2 recordings, read and written without ROS, and their replay through the estimators."""
