"""What a solved flow does to the body's surface: pressure, friction, and the split of the drag."""
