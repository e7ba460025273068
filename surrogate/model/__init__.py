"""Drag models: the network, a trained surrogate with its record, its folder; and kriging."""
