"""What a motion is certified to keep of lines of sight."""

from __future__ import annotations

from protocol.messages import Motion

NOTHING, CHAIN, TEAM, AGENT = range(4)
"""Nothing; base station and last relays; all that are scheduled; these and the agent's next moments."""


def joined_members(motion: Motion) -> frozenset[str]:
    """The members that stay in one network."""
    if motion.connection == "team":
        return frozenset(way.member for way in motion.ways)
    return frozenset(motion.joined if motion.connection == "joined" else ())


def certified_level(motion: Motion, agent: str) -> int:
    """One of the levels above."""
    joined = joined_members(motion)
    if len(joined) < 2:
        return NOTHING
    if not joined.issuperset(way.member for way in motion.ways if way.scheduled):
        return CHAIN
    return AGENT if agent in joined else TEAM
