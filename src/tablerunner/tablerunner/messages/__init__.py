"""ROS messages to records, for every class with the fields: those of rclpy and of rosbags.

The nodes and the replay of a bag read messages by these same functions, so that they cannot see
different things. No ROS is imported: a message is known by its fields.

``X_from_message`` returns a record, or a `Refusal` where the message cannot be one; nothing in a
message makes it raise. Whether the values make sense (a negative range, an unknown anchor) is for
the parts that use them to judge. The way back, records to messages, needs the classes of one side:
``tablerunner_ros.conversions`` and `tablerunner.bags.messages`.
"""
