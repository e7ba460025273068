"""Files and pictures of a solved flow: one folder that ParaView, NumPy and people can read."""
