"""Start the whole robot: ros2 launch tablerunner_bringup delivery.launch.py simulated:=true.

The nodes and their parameters are those of `tablerunner_bringup.nodes`, which `tablerunner launch`
uses as well.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from tablerunner_bringup.description import ARGUMENTS, describe


def generate_launch_description():
    """Return the arguments, and the nodes once the arguments are known."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, default, description in ARGUMENTS
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])


def _nodes(context):
    values = {
        name: LaunchConfiguration(name).perform(context) for name, _default, _words in ARGUMENTS
    }
    return [
        Node(
            package=node.package,
            executable=node.executable,
            name=node.name,
            namespace=node.namespace,
            parameters=[node.parameters, *node.parameter_files],
            remappings=list(node.remap),
            output='screen',
            # Without one of its nodes the robot has no business driving.
            on_exit=Shutdown(reason=f'{node.name} ended'),
        )
        for node in describe(values)
    ]
