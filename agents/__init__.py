"""Agents: the roles of a mission (base station, robots, tracked agent) and the shells that run them."""
