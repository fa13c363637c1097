"""Estimation: where the tracked agent is, from range measurements alone (thesis chapter 2).

Empty on purpose until the estimation engine lands; in this version the agent announces where it is.
"""
