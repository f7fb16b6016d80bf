"""Records of the core to messages of rclpy, and back: pure functions, one noun per file.

``X_to_message`` makes a message, ``fill_X`` writes into one that exists and has its frames.
``X_from_message`` returns a record, or a `Refusal` where the message cannot be one; these are
`tablerunner.messages`, which the replay of bags uses as well, so that both see the same.
"""
