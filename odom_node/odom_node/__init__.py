"""Node: wheel encoders and IMU to odom and the transform odom to base_link."""
