"""Pictures without a display: flows, shape histories, surface stresses, and the web page."""
