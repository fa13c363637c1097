"""Sending a goal to the tracked agent of a running team, as any operator may."""

from __future__ import annotations

import secrets
import socket
import time

from agents.mission import Mission
from launcher.scenario import ScenarioFault
from protocol.bus import Received
from protocol.inbox import Inbox
from protocol.keys import Address
from protocol.messages import Envelope, Goal, GoalReply, MalformedMessage, Point, decode, encode
from protocol.zenoh_bus import ZenohBus

REPEAT_S = 0.25
ANSWER_WITHIN_S = 5.0


def send_goal(mission: Mission, goal: Point) -> GoalReply:
    """Ask the agent to go somewhere, again and again until it answers.

    Raises:
        ScenarioFault: no team runs, or the agent does not answer within :data:`ANSWER_WITHIN_S`.
    """
    endpoints = [entry.endpoint for entry in mission.roster]
    if not any(_listens(endpoint) for endpoint in endpoints):
        raise ScenarioFault(
            f"team '{mission.team}' does not run: none of its peers listens; start it with `sightline run`, "
            "or name the folder of a running team with --run"
        )
    name, correlation = f"goal_{secrets.token_hex(4)}", secrets.token_hex(8)
    key = Address(mission.team, name, "goal", operator=True).key
    agent = mission.tracked_agent.name
    inbox: Inbox[None] = Inbox()
    bus = ZenohBus.open(mission.team, name, None, endpoints, inbox.put, operator=True)
    try:
        until_s, sequence = time.monotonic() + ANSWER_WITHIN_S, 0
        while time.monotonic() < until_s:
            envelope = Envelope(
                sender=name,
                incarnation=0,
                sequence=sequence,
                sent_at_s=time.time(),
                body=Goal(goal=goal, correlation=correlation),
            )
            sequence += 1
            bus.publish(key, encode(envelope))
            again_s = time.monotonic() + REPEAT_S
            while (left_s := again_s - time.monotonic()) > 0:
                for event in inbox.wait(left_s):
                    reply = _reply(event, mission.team, agent) if isinstance(event, Received) else None
                    if reply is not None and reply.correlation == correlation:
                        return reply
    finally:
        bus.close()
    raise ScenarioFault(
        f"the agent of team '{mission.team}' did not answer within {ANSWER_WITHIN_S:g} s; "
        "it may be restarting: look at the run's status, and try again"
    )


def _reply(event: Received, team: str, agent: str) -> GoalReply | None:
    """The agent's reply to some goal, if this is one."""
    if event.key != Address(team, agent, "goal_reply").key:
        return None
    try:
        body = decode(event.payload).body
    except MalformedMessage:
        return None
    return body if isinstance(body, GoalReply) else None


def _listens(endpoint: str) -> bool:
    """Whether somebody accepts connections at ``tcp/HOST:PORT``."""
    host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
    try:
        with socket.create_connection((host, int(port)), timeout=1.0):
            return True
    except (OSError, ValueError):
        return False
