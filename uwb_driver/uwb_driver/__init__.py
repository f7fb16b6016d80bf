"""Node: UWB exchanges or a real device to calibrated ranges and a UWB-only fix."""
