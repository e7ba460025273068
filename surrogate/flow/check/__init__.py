"""Checks of a flow: its estimated error, and a march in time that shares no solver with it."""
