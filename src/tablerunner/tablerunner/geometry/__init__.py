"""Angles, planar poses, segments: geometry without any notion of robots."""
