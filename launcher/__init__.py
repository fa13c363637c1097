"""Launcher: scenarios, processes, simulation and review; the command line."""
