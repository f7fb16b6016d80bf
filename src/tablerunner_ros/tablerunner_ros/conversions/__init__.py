"""Messages to records of the core and back: pure functions, one noun per file.

``X_from_message`` returns a record, or a `Refusal` where the message cannot be one; nothing in a
message makes it raise. Whether the values make sense (a negative range, an unknown anchor) is for
the core to judge. ``X_to_message`` makes a message, ``fill_X`` writes into one that exists.
"""
