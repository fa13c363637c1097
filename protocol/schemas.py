"""The messages as a reader of any language wants them: ``python -m protocol.schemas docs/messages``.

Writes a JSON Schema of the envelope and of each body, and a page with keys, fields and a checked example of each. All
of it comes from :mod:`protocol.messages` and the files that it joins, the text included; a test keeps the committed
files equal to what is made.
"""

from __future__ import annotations

import ast
import inspect
import itertools
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import msgspec

from protocol import keys, messages, wire_types
from protocol.examples import EXAMPLES
from protocol.messages import (
    BODIES,
    PERIODIC_KINDS,
    Aim,
    Auction,
    Authority,
    Body,
    ConvexPiece,
    Deployment,
    Envelope,
    Goal,
    GoalReply,
    HeardRanges,
    Intent,
    LastHeard,
    LinkView,
    MemberWay,
    Milestone,
    Motion,
    NewLink,
    Offer,
    Placement,
    Progress,
    RangeReply,
    Reign,
    Ring,
    SharedRange,
    Topology,
    Tree,
    TreeProposal,
    VoteRequest,
    Warrant,
)

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"

SPEAKERS: Final = {
    "heartbeat": ("every peer", "at `heartbeat_hz`, unless it has said `state` or `intent` since the last one was due"),
    "state": ("base station, robots", "at `control_hz`, and with every change of progress"),
    "intent": ("a tracked agent that announces", "at `control_hz`"),
    "goal": ("an operator", "when a person wants; again until replied"),
    "goal_reply": ("tracked agent", "for each goal heard"),
    "deployment": ("the leader", "with every decision, and again while it holds"),
    "vote_request": (
        "who stands for leader, and the leader",
        "eight times in a lease; the leader four times if all answer, sixteen if too few do",
    ),
    "vote": ("every peer, to who asked", "for each vote request heard"),
    "topology": ("the leader", "four times a second, and with every change"),
    "confirmation": (
        "base station, robots",
        "once a second, each time that an open proposal is said, and with every change",
    ),
    "auction": ("the leader", "before a plan by auction; again until it closes"),
    "bid": ("base station, robots", "for each auction heard"),
    "range_request": ("base station, robots", "at `ranging.rate_hz`, if the agent is independent"),
    "range_reply": ("an independent tracked agent, to who asked", "for each request from in line of sight"),
    "ranges": ("base station, robots", "with each range measured, and for who lacks some"),
    "range_digest": ("base station, robots", "once a second"),
    "range_base": ("base station, robots", "for who lacks ranges that nobody keeps any more"),
}
"""Kind → who says it, how often."""

PAGE: Final = """\
# What the peers say

Made by `make docs` from `protocol/messages.py` and the files that it joins: change it there.

Every peer is a zenoh peer and publishes JSON (encoding `application/json`) under keys of its own. Nothing but zenoh and
a JSON reader is needed to listen in or to send a goal; [an example](../../examples/README.md) does both. Peers do not
relay, so connect to the endpoint of each one that you want to hear: `runs/<name>/mission.json` lists them.

## Keys

{keys}

`<team>`, `<peer>`, `<to>` and `<name>` are up to 32 lower-case letters, digits and `_`, a letter first; no peer is
called `{operator}`. A message counts only if its `sender` is the one that its key names. What is said under a key that
ends in `<to>` is for that peer; `<team>/{version}/**` brings you these too. A kind that is *latest only* says all that
the ones before said: who is slow may skip to the last one. The rates are in the mission file.

## Asking

Who comes late need not wait until all has been said again. Every peer answers queries on its own keys with what it has
said last, in the last {stands_for:g} seconds, of each standing kind:
{standing}.

```python
config = zenoh.Config()
config.insert_json5("connect/endpoints", json.dumps([peer["endpoint"] for peer in mission["roster"]]))
with zenoh.open(config) as session:
    for reply in session.get(f"{{mission['team']}}/{version}/**", target=zenoh.QueryTarget.ALL, timeout=1.0):
        print(reply.ok.key_expr, json.loads(reply.ok.payload.to_bytes())["body"])
```

The answers are the messages themselves, with the key, `incarnation` and `sequence` under which they were said. Peers
ask in the same way when they see another one's liveliness token.

## Envelope

Each payload is one envelope ([schema]({envelope}.schema.json)), at most {limit} bytes long.

{envelope_fields}

Kinds can overtake one another on the way, and anything can be lost or come twice. To tell old from new, compare
(`incarnation`, `sequence`) with the last one of the same sender *and kind*.

## Bodies

{bodies}

## Parts of bodies

{parts}

## Types

{types}

## Versions

The `{version}` in the keys and `schema` in the envelope are one number. It rises when a change would mislead a reader
of before: a field that goes, or that means something else. A reader refuses a schema that it does not know, and never
sees one if it listens to `{version}` only. What it can do without is added under the same number: new kinds, and new
fields with a default. So ignore kinds and fields that you do not know; the peers do.
"""


def documents() -> dict[str, str]:
    """File name → text of everything that is published about the messages."""
    texts = {f"{kind}.schema.json": _schema(body) for kind, body in BODIES.items()}
    texts["envelope.schema.json"] = _schema(Envelope)
    texts["README.md"] = _page()
    return texts


def example_payloads() -> dict[str, bytes]:
    """Kind → a payload of that kind as it stands on the wire."""
    return {
        messages.kind_of(body): messages.encode(
            Envelope(sender=_speaker(body), incarnation=0, sequence=311, sent_at_s=1767225600.25, body=body)
        )
        for body in EXAMPLES
    }


def _speaker(body: Body) -> str:
    match body:
        case Goal():
            return "ada"
        case Intent() | GoalReply() | RangeReply():
            return "agent"
        case Deployment():
            return "base"
        case VoteRequest() | Topology() | Auction():
            return "robot2"
        case _:
            return "robot1"


def _schema(struct: type[msgspec.Struct]) -> str:
    schema = {"$schema": DIALECT, **msgspec.json.schema(struct)}
    for name, definition in schema["$defs"].items():
        definition["description"] = _plain(definition["description"])
        meanings = {field: meaning for field, _, meaning in _fields(getattr(messages, name))}
        for field, content in definition["properties"].items():
            if meanings.get(field):
                content["description"] = meanings[field]
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def _page() -> str:
    payloads = example_payloads()
    rows: list[tuple[str, ...]] = []
    for kind, body in BODIES.items():
        speaker, rate = SPEAKERS[kind]
        latest = "; latest only" if kind in PERIODIC_KINDS else ""
        rows.append((f"`{_key(kind)}`", speaker, f"{rate}{latest}", f"[{_first_sentence(body)}](#{kind})"))
    alive = keys.Address("<team>", "<peer>", keys.ALIVE).key
    rows.append(
        (f"`{alive}`", "every peer", "a liveliness token", "Its process is up: gone at its end, or 1 s after a cut")
    )
    bodies = [
        f"### {kind}\n\n{_plain(inspect.getdoc(body) or '')} [Schema]({kind}.schema.json).\n\n"
        f"{_field_table(body)}\n\n`{_key(kind)}`\n\n"
        f"```json\n{_readable(payloads[kind])}\n```"
        for kind, body in BODIES.items()
    ]
    parts = [
        f"### {part.__name__}\n\n{_plain(inspect.getdoc(part) or '')}\n\n{_field_table(part)}"
        for part in (
            Authority,
            Progress,
            Motion,
            MemberWay,
            Placement,
            Reign,
            Warrant,
            LastHeard,
            Tree,
            TreeProposal,
            NewLink,
            Milestone,
            LinkView,
            Offer,
            Aim,
            SharedRange,
            HeardRanges,
            ConvexPiece,
            Ring,
        )
    ]
    types: list[tuple[str, ...]] = [
        (f"`{name}`", f"`{json.dumps(msgspec.json.schema(getattr(messages, name)))}`".replace("|", "\\|"), meaning)
        for name, meaning in _aliases()
    ]
    return PAGE.format(
        keys=_table(("key", "who", "how often", "what"), rows),
        operator=keys.OPERATOR,
        version=keys.VERSION,
        standing=", ".join(f"`{kind}`" for kind in BODIES if kind in messages.STANDING_KINDS),
        stands_for=messages.STANDS_FOR_S,
        envelope="envelope",
        limit=f"{messages.MAXIMUM_PAYLOAD_BYTES:,}",
        envelope_fields=_field_table(Envelope),
        bodies="\n\n".join(bodies),
        parts="\n\n".join(parts),
        types=_table(("type", "JSON Schema", "meaning"), types),
    )


def _key(kind: str) -> str:
    if BODIES[kind] is Goal:
        return keys.Address("<team>", "<name>", kind, operator=True).key
    return keys.Address("<team>", "<peer>", kind, to="<to>" if kind in keys.ADDRESSED_KINDS else "").key


def _field_table(struct: type[msgspec.Struct]) -> str:
    rows: list[tuple[str, ...]] = [(f"`{name}`", kind, text) for name, kind, text in _fields(struct)]
    return _table(("field", "type", "meaning"), rows)


def _fields(struct: type[msgspec.Struct]) -> Iterator[tuple[str, str, str]]:
    """Name, type and meaning of each field, from the source: Python keeps no docstrings of fields."""
    (definition,) = ast.parse(inspect.getsource(struct)).body
    assert isinstance(definition, ast.ClassDef)
    for statement, after in zip(definition.body, [*definition.body[1:], None], strict=True):
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            default = "" if statement.value is None else f"; `{_json(statement.value)}` if left out"
            yield statement.target.id, _type(ast.unparse(statement.annotation)) + default, _docstring(after)


def _aliases() -> Iterator[tuple[str, str]]:
    """Name and meaning of each type that fields refer to."""
    statements = ast.parse(inspect.getsource(wire_types)).body
    for statement, after in itertools.pairwise(statements):
        match statement:
            case ast.AnnAssign(target=ast.Name(id=name), annotation=ast.Name(id="TypeAlias")):
                yield name, _docstring(after)


def _docstring(statement: ast.stmt | None) -> str:
    match statement:
        case ast.Expr(value=ast.Constant(value=str(text))):
            return _plain(text)
        case _:
            return ""


def _type(annotation: str) -> str:
    if bounded := re.fullmatch(r"Annotated\[(.+), msgspec\.Meta\((.+)\)\]", annotation):
        return f"{_type(bounded[1])} ({_limits(bounded[2])})"
    annotation = annotation.replace(" | None", " or null")
    annotation = re.sub(r"tuple\[(.+), \.\.\.\]", r"list of \1", annotation)
    annotation = re.sub(r"tuple\[(\w+), \1\]", r"pairs of \1", annotation)
    return {"bool": "boolean", "float": "number", "AnyBody": "one of the bodies", "Literal[1]": "1"}.get(
        annotation, annotation
    )


def _limits(arguments: str) -> str:
    """Limits in words: ``ge=-1, le=5`` is at least -1, at most 5."""
    words = {"ge": "at least", "le": "at most", "min_length": "at least", "max_length": "at most"}
    limits = (argument.split("=") for argument in arguments.split(", "))
    return ", ".join(f"{words[name]} {value}" for name, value in limits)


def _readable(payload: bytes) -> str:
    """Indented JSON, with lists of numbers or names on one line."""
    text = msgspec.json.format(payload, indent=2).decode()
    return re.sub(r"\[\s+((?:[^\s,\[{]+,\s+)*[^\s,\[{]+)\s+\]", _on_one_line, text)


def _on_one_line(found: re.Match[str]) -> str:
    return f"[{' '.join(found[1].split())}]"


def _json(value: ast.expr) -> str:
    default: Any = getattr(messages, value.id) if isinstance(value, ast.Name) else ast.literal_eval(value)
    return json.dumps(default)


def _plain(text: str) -> str:
    """Docstring without markup of reStructuredText, on one line."""
    text = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", text)
    return " ".join(text.replace("``", "`").split())


def _first_sentence(body: type[Body]) -> str:
    return _plain(inspect.getdoc(body) or "").split(". ")[0].rstrip(".")


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main(arguments: list[str]) -> int:
    """Write the documents into a folder, which is made if need be."""
    if len(arguments) != 1:
        print("usage: python -m protocol.schemas FOLDER", file=sys.stderr)
        return 2
    folder = Path(arguments[0])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in documents().items():
        (folder / name).write_text(text, encoding="utf-8")
    print(f"{folder}: {len(documents())} files about the messages")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
