"""`tablerunner emulate`: the devices of a robot in real time, for those whose robot is not there.

Unlike sim_bridge it takes the place of the robot's own drivers and nothing else: host time, no
/clock, messages as the drivers write them, bytes on a port as a UWB module sends them.
"""
