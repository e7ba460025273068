"""How far a flow can be trusted: its estimated error, and a march in time that shares no solver."""
