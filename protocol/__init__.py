"""Protocol: what the peers say to one another, and the buses that carry it."""
