"""Particle filters and what they are made of; everything is vectorised over the particles."""
