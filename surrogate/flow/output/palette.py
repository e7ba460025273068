"""Colours that all pictures share."""

INK = "#1a1a1a"  # lines and words
QUIET = "#5f6368"  # notes
BODY = "#f2efe6"  # bodies in a flow
