"""Finding out, from a drive, where the anchors hang and how large the wheels are."""
