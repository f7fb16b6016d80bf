"""The node of the camera under the ceiling."""
