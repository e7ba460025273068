"""Drag networks: the network, a trained surrogate with its scene and record, and its folder."""
