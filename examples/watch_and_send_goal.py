"""Watch a running team and send its agent somewhere, with nothing but eclipse-zenoh and json.

    python examples/watch_and_send_goal.py --mission runs/latest/mission.json --goal 12.5,4 --seconds 20
    python examples/watch_and_send_goal.py --team office --connect tcp/127.0.0.1:17447 --connect tcp/127.0.0.1:17448

What the messages mean: docs/messages/README.md. Peers do not relay, so this program hears exactly those whose endpoints
it is given; a mission file lists all. Ends with status 0, or 1 if the goal was refused or nobody answered.
"""

import argparse
import json
import os
import queue
import time
import uuid
from pathlib import Path

os.environ.setdefault("ZENOH_RUNTIME", "(rx: (worker_threads: 16))")  # a vanishing peer must not stop the others

import zenoh


def main() -> int:
    """Listen for some seconds; if there is a goal, say it until it is answered."""
    options = read_options()
    team, name = options.team, options.name
    config = zenoh.Config()
    for place, value in {
        "mode": "peer",
        "listen/endpoints": [],
        "connect/endpoints": options.connect,
        "connect/timeout_ms": -1,  # go on dialling: peers may come later, or come back
        "connect/exit_on_failure": False,
        "open/return_conditions/connect_scouted": False,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/tx/lease": 1000,
    }.items():
        config.insert_json5(place, json.dumps(value))

    said: queue.SimpleQueue = queue.SimpleQueue()  # zenoh calls from its own threads: only queue there
    peers, latest, sequence, answer = set(), {}, 0, None
    goal = {"kind": "goal", "goal": options.goal, "correlation": uuid.uuid4().hex}
    incarnation, began = int(time.time() * 1000), time.monotonic()
    with zenoh.open(config) as session:
        session.declare_subscriber(f"{team}/v1/**", said.put)
        session.liveliness().declare_subscriber(f"{team}/v1/*/alive", said.put, history=True)
        next_look = began
        while (elapsed := time.monotonic() - began) < options.seconds:
            if options.goal and not answer:  # said again until it is answered
                envelope = {"schema": 1, "sender": name, "incarnation": incarnation, "sequence": sequence}
                payload = json.dumps({**envelope, "sent_at_s": time.time(), "body": goal})
                session.put(f"{team}/v1/operator/{name}/goal", payload, encoding="application/json")
                sequence += 1
            next_look += 0.5
            while (rest := next_look - time.monotonic()) > 0:
                try:
                    sample = said.get(timeout=rest)
                except queue.Empty:
                    break
                _, _, speaker, kind, *more = str(sample.key_expr).split("/")
                if more:
                    continue  # from an operator, or for one peer only
                if kind == "alive":
                    (peers.add if sample.kind == zenoh.SampleKind.PUT else peers.discard)(speaker)
                    continue
                try:
                    body = json.loads(sample.payload.to_string())["body"]
                except (ValueError, TypeError, KeyError):
                    continue  # not one of the team's messages
                latest[kind] = speaker, body
                if kind == "goal_reply" and body["correlation"] == goal["correlation"] and not answer:
                    answer = body
                    print(f"{speaker} {'accepts' if body['accepted'] else 'refuses: ' + body['reason']}", flush=True)
            print(f"{elapsed:5.1f} s  {describe(peers, latest)}", flush=True)
    if options.goal and not answer:
        print("nobody answered: are these the team's name and the endpoints of all of its peers?")
    return 0 if not options.goal or (answer and answer["accepted"]) else 1


def describe(peers: set, latest: dict) -> str:
    """The team in a line: who is up, where the agent is and goes, which links hold it to the base station."""
    words = ["up: " + (" ".join(sorted(peers)) or "nobody yet")]
    if "intent" in latest:
        agent, intent = latest["intent"]
        words.append("{} at ({:.1f}, {:.1f})".format(agent, *intent["position"]))
        words.append("going to ({:.1f}, {:.1f})".format(*intent["goal"]) if intent.get("goal") else "without a goal")
    if "deployment" in latest:
        leader, deployment = latest["deployment"]
        chain = ", ".join(f"{a}–{b}" for a, b in deployment["edges"])
        words.append(f"chain {chain} (decision {deployment['decision']} of {leader}: {deployment['reason']})")
    return "; ".join(words)


def read_options() -> argparse.Namespace:
    """The command line, completed by the mission file."""

    def point(text: str) -> list:
        x, y = text.split(",")
        return [float(x), float(y)]

    def mission(path: str) -> dict:
        try:
            return json.loads(Path(path).read_text(encoding="utf-8"))
        except (OSError, ValueError) as problem:
            raise argparse.ArgumentTypeError(f"{path} cannot be read: {problem}") from problem

    parser = argparse.ArgumentParser(description="Watch a running team and send its agent somewhere.")
    parser.add_argument("--mission", type=mission, metavar="FILE", help="of the run: gives the team and all endpoints")
    parser.add_argument("--team", help="name of the team")
    parser.add_argument("--connect", action="append", default=[], metavar="ENDPOINT", help="of a peer; once for each")
    parser.add_argument(
        "--goal", type=point, metavar="X,Y", help="where to send the agent, metres; --goal=-1,2 if X < 0"
    )
    parser.add_argument("--name", default="visitor", help="whose prefix the goal is said under: team/v1/operator/NAME")
    parser.add_argument("--seconds", type=float, default=10.0, help="how long to watch")
    options = parser.parse_args()
    if options.mission:
        options.team = options.team or options.mission["team"]
        options.connect += [peer["endpoint"] for peer in options.mission["roster"]]
    if not options.team or not options.connect:
        parser.error("say which team: --mission FILE, or --team NAME and --connect ENDPOINT for each peer")
    return options


if __name__ == "__main__":
    raise SystemExit(main())
