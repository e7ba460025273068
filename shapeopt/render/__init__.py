"""Pictures of runs, offscreen: flows side by side, evolutions, loads, a page, files for CAD."""
